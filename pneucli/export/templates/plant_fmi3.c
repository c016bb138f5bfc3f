/* Plant of the pipeline @PIPELINE@ as an FMU (FMI 3.0, co-simulation and model exchange), written by pneucli @VERSION@. */
#include "fmi3Functions.h"

typedef fmi3LogMessageCallback Log;

static void tell(Log log, void *environment, const char *message)
{
    log(environment, fmi3Error, "logStatusError", message);
}

#include "plant_core.h"

/* Common functions */

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)instance; (void)on; (void)n; (void)categories;
    return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean event_mode, fmi3Boolean early_return, const fmi3ValueReference intermediate[], size_t n_intermediate,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)name; (void)resources; (void)visible; (void)logging; (void)event_mode; (void)early_return;
    (void)intermediate; (void)n_intermediate; (void)update;
    return instantiate(token, environment, log, 0);
}

fmi3Instance fmi3InstantiateModelExchange(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name; (void)resources; (void)visible; (void)logging;
    return instantiate(token, environment, log, 1);
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)environment; (void)log;
    (void)update; (void)lock; (void)unlock;
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    free(instance);
}

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean tolerance_defined, fmi3Float64 tolerance, fmi3Float64 start_time,
    fmi3Boolean stop_time_defined, fmi3Float64 stop_time)
{
    (void)tolerance_defined; (void)tolerance; (void)stop_time_defined; (void)stop_time;
    begin(instance, start_time);
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    return (fmi3Status)finish_initialization(instance);
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    ((Instance *)instance)->plant.mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    reset(&((Instance *)instance)->plant);
    return fmi3OK;
}

/* Variables */

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr, fmi3Float64 values[],
                          size_t n)
{
    if (n != n_vr) {
        return (fmi3Status)fail(instance, "as many values as value references are needed");
    }
    return (fmi3Status)get_values(instance, vr, n, values);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr,
                          const fmi3Float64 values[], size_t n)
{
    if (n != n_vr) {
        return (fmi3Status)fail(instance, "as many values as value references are needed");
    }
    return (fmi3Status)set_values(instance, vr, n, values);
}

#define NONE(KIND)                                                                                               \
    fmi3Status fmi3Get##KIND(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr,                  \
                             fmi3##KIND values[], size_t n)                                                      \
    {                                                                                                            \
        (void)vr; (void)n_vr; (void)values;                                                                      \
        return n == 0 ? fmi3OK : (fmi3Status)fail(instance, "no variable has this type");                        \
    }                                                                                                            \
    fmi3Status fmi3Set##KIND(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr,                  \
                             const fmi3##KIND values[], size_t n)                                                \
    {                                                                                                            \
        (void)vr; (void)n_vr; (void)values;                                                                      \
        return n == 0 ? fmi3OK : (fmi3Status)fail(instance, "no variable has this type");                        \
    }

NONE(Float32)
NONE(Int8)
NONE(UInt8)
NONE(Int16)
NONE(UInt16)
NONE(Int32)
NONE(UInt32)
NONE(Int64)
NONE(UInt64)
NONE(Boolean)
NONE(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr, size_t sizes[],
                         fmi3Binary values[], size_t n)
{
    (void)vr; (void)n_vr; (void)sizes; (void)values;
    return n == 0 ? fmi3OK : (fmi3Status)fail(instance, "no variable has this type");
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr, const size_t sizes[],
                         const fmi3Binary values[], size_t n)
{
    (void)vr; (void)n_vr; (void)sizes; (void)values;
    return n == 0 ? fmi3OK : (fmi3Status)fail(instance, "no variable has this type");
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr, fmi3Clock values[])
{
    (void)vr; (void)values;
    return n_vr == 0 ? fmi3OK : (fmi3Status)fail(instance, "there are no clocks");
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr, const fmi3Clock values[])
{
    (void)vr; (void)values;
    return n_vr == 0 ? fmi3OK : (fmi3Status)fail(instance, "there are no clocks");
}

/* State */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    return (fmi3Status)get_state(instance, state);
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    return (fmi3Status)set_state(instance, state);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    (void)instance;
    return (fmi3Status)free_state(state);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    (void)instance; (void)state;
    *size = sizeof(Plant);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return (fmi3Status)serialize_state(instance, state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    return (fmi3Status)deserialize_state(instance, bytes, size, state);
}

/* Co-simulation */

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_set_state,
                      fmi3Boolean *event_handling, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_time)
{
    Instance *own = instance;
    fmi3Status status;
    (void)no_set_state;
    *event_handling = fmi3False;
    *terminate = fmi3False;
    *early_return = fmi3False;
    *last_time = time;
    status = (fmi3Status)advance(own, own->plant.inputs, time, step);
    if (status == fmi3OK) {
        *last_time = own->plant.time;
    }
    return status;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t n)
{
    (void)vr; (void)n_vr; (void)orders; (void)values;
    return n == 0 ? fmi3OK : (fmi3Status)fail(instance, "there are no derivatives of outputs");
}

/* Model exchange */

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    ((Instance *)instance)->plant.now = time;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *needs_update, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                                    fmi3Boolean *has_next_event, fmi3Float64 *next_event)
{
    *needs_update = fmi3False;
    *terminate = fmi3False;
    *nominals_changed = fmi3False;
    *values_changed = fmi3False;
    *has_next_event = fmi3True;
    return (fmi3Status)take_event(instance, next_event);
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean keep_state, fmi3Boolean *enter_event_mode,
                                       fmi3Boolean *terminate)
{
    (void)instance; (void)keep_state;
    *enter_event_mode = fmi3False;
    *terminate = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n)
{
    (void)instance;
    *n = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n)
{
    (void)instance;
    *n = 0;
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 states[], size_t n)
{
    (void)states;
    return n == 0 ? fmi3OK : (fmi3Status)fail(instance, "there are no continuous states");
}

#define NO_STATES(NAME)                                                                                          \
    fmi3Status NAME(fmi3Instance instance, fmi3Float64 values[], size_t n)                                       \
    {                                                                                                            \
        (void)values;                                                                                            \
        return n == 0 ? fmi3OK : (fmi3Status)fail(instance, "there are no continuous states");                   \
    }

NO_STATES(fmi3GetContinuousStates)
NO_STATES(fmi3GetContinuousStateDerivatives)
NO_STATES(fmi3GetNominalsOfContinuousStates)
NO_STATES(fmi3GetEventIndicators)

/* What this FMU does not offer */

#define REFUSE(NAME, ARGUMENTS)                                                                                  \
    fmi3Status NAME ARGUMENTS                                                                                    \
    {                                                                                                            \
        return (fmi3Status)fail(instance, #NAME " is not offered");                                              \
    }

REFUSE(fmi3GetNumberOfVariableDependencies, (fmi3Instance instance, fmi3ValueReference a, size_t *b))
REFUSE(fmi3GetVariableDependencies, (fmi3Instance instance, fmi3ValueReference a, size_t b[], fmi3ValueReference c[],
                                     size_t d[], fmi3DependencyKind e[], size_t f))
REFUSE(fmi3GetDirectionalDerivative, (fmi3Instance instance, const fmi3ValueReference a[], size_t b,
                                      const fmi3ValueReference c[], size_t d, const fmi3Float64 e[], size_t f,
                                      fmi3Float64 g[], size_t h))
REFUSE(fmi3GetAdjointDerivative, (fmi3Instance instance, const fmi3ValueReference a[], size_t b,
                                  const fmi3ValueReference c[], size_t d, const fmi3Float64 e[], size_t f,
                                  fmi3Float64 g[], size_t h))
REFUSE(fmi3GetIntervalDecimal, (fmi3Instance instance, const fmi3ValueReference a[], size_t b, fmi3Float64 c[],
                                fmi3IntervalQualifier d[]))
REFUSE(fmi3GetIntervalFraction, (fmi3Instance instance, const fmi3ValueReference a[], size_t b, fmi3UInt64 c[],
                                 fmi3UInt64 d[], fmi3IntervalQualifier e[]))
REFUSE(fmi3GetShiftDecimal, (fmi3Instance instance, const fmi3ValueReference a[], size_t b, fmi3Float64 c[]))
REFUSE(fmi3GetShiftFraction, (fmi3Instance instance, const fmi3ValueReference a[], size_t b, fmi3UInt64 c[],
                              fmi3UInt64 d[]))
REFUSE(fmi3SetIntervalDecimal, (fmi3Instance instance, const fmi3ValueReference a[], size_t b, const fmi3Float64 c[]))
REFUSE(fmi3SetIntervalFraction, (fmi3Instance instance, const fmi3ValueReference a[], size_t b, const fmi3UInt64 c[],
                                 const fmi3UInt64 d[]))
REFUSE(fmi3SetShiftDecimal, (fmi3Instance instance, const fmi3ValueReference a[], size_t b, const fmi3Float64 c[]))
REFUSE(fmi3SetShiftFraction, (fmi3Instance instance, const fmi3ValueReference a[], size_t b, const fmi3UInt64 c[],
                              const fmi3UInt64 d[]))
REFUSE(fmi3EvaluateDiscreteStates, (fmi3Instance instance))
REFUSE(fmi3ActivateModelPartition, (fmi3Instance instance, fmi3ValueReference a, fmi3Float64 b))
