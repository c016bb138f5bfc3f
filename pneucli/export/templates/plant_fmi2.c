/* Plant of the pipeline @PIPELINE@ as an FMU (FMI 2.0, co-simulation and model exchange), written by pneucli @VERSION@. */
#include "fmi2Functions.h"

typedef fmi2CallbackLogger Log;

static void tell(Log log, void *environment, const char *message)
{
    log(environment, "pneucli_plant", fmi2Error, "logStatusError", "%s", message);
}

#include "plant_core.h"

/* Common functions */

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)c; (void)on; (void)n; (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)name; (void)resources; (void)visible; (void)logging;
    return instantiate(token, functions->componentEnvironment, functions->logger, type == fmi2ModelExchange);
}

void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean stop_time_defined, fmi2Real stop_time)
{
    (void)tolerance_defined; (void)tolerance; (void)stop_time_defined; (void)stop_time;
    ((Instance *)c)->plant.time = start_time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    begin(c, ((Instance *)c)->plant.time);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return (fmi2Status)finish_initialization(c);
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    ((Instance *)c)->plant.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    reset(&((Instance *)c)->plant);
    return fmi2OK;
}

/* Variables */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[])
{
    return (fmi2Status)get_values(c, vr, n, values);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[])
{
    return (fmi2Status)set_values(c, vr, n, values);
}

#define NONE(KIND)                                                                                               \
    fmi2Status fmi2Get##KIND(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2##KIND values[])      \
    {                                                                                                            \
        (void)vr; (void)values;                                                                                  \
        return n == 0 ? fmi2OK : (fmi2Status)fail(c, "no variable has this type");                               \
    }                                                                                                            \
    fmi2Status fmi2Set##KIND(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2##KIND values[]) \
    {                                                                                                            \
        (void)vr; (void)values;                                                                                  \
        return n == 0 ? fmi2OK : (fmi2Status)fail(c, "no variable has this type");                               \
    }

NONE(Integer)
NONE(Boolean)
NONE(String)

/* State */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    return (fmi2Status)get_state(c, state);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    return (fmi2Status)set_state(c, state);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    return (fmi2Status)free_state(state);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c; (void)state;
    *size = sizeof(Plant);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return (fmi2Status)serialize_state(c, state, bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return (fmi2Status)deserialize_state(c, bytes, size, state);
}

/* Co-simulation */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_set_state)
{
    (void)no_set_state;
    return (fmi2Status)advance(c, ((Instance *)c)->plant.inputs, time, step);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime) {
        return (fmi2Status)fail(c, "no step is pending");
    }
    *value = ((Instance *)c)->plant.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    (void)c; (void)kind;
    *value = fmi2False; /* a step is never terminated early */
    return fmi2OK;
}

/* Model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    ((Instance *)c)->plant.now = time;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    info->newDiscreteStatesNeeded = fmi2False;
    info->terminateSimulation = fmi2False;
    info->nominalsOfContinuousStatesChanged = fmi2False;
    info->valuesOfContinuousStatesChanged = fmi2False;
    info->nextEventTimeDefined = fmi2True;
    return (fmi2Status)take_event(c, &info->nextEventTime);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean keep_state, fmi2Boolean *enter_event_mode,
                                       fmi2Boolean *terminate)
{
    (void)c; (void)keep_state;
    *enter_event_mode = fmi2False;
    *terminate = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real states[], size_t n)
{
    (void)states;
    return n == 0 ? fmi2OK : (fmi2Status)fail(c, "there are no continuous states");
}

#define NO_STATES(NAME)                                                                                          \
    fmi2Status NAME(fmi2Component c, fmi2Real values[], size_t n)                                                \
    {                                                                                                            \
        (void)values;                                                                                            \
        return n == 0 ? fmi2OK : (fmi2Status)fail(c, "there are no continuous states");                          \
    }

NO_STATES(fmi2GetContinuousStates)
NO_STATES(fmi2GetDerivatives)
NO_STATES(fmi2GetNominalsOfContinuousStates)
NO_STATES(fmi2GetEventIndicators)

/* What this FMU does not offer */

#define REFUSE(NAME, ARGUMENTS)                                                                                  \
    fmi2Status NAME ARGUMENTS                                                                                    \
    {                                                                                                            \
        return (fmi2Status)fail(c, #NAME " is not offered");                                                     \
    }

REFUSE(fmi2GetDirectionalDerivative, (fmi2Component c, const fmi2ValueReference a[], size_t b,
                                      const fmi2ValueReference d[], size_t e, const fmi2Real f[], fmi2Real g[]))
REFUSE(fmi2SetRealInputDerivatives, (fmi2Component c, const fmi2ValueReference a[], size_t b, const fmi2Integer d[],
                                     const fmi2Real e[]))
REFUSE(fmi2GetRealOutputDerivatives, (fmi2Component c, const fmi2ValueReference a[], size_t b, const fmi2Integer d[],
                                      fmi2Real e[]))
REFUSE(fmi2CancelStep, (fmi2Component c))
REFUSE(fmi2GetStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Status *value))
REFUSE(fmi2GetIntegerStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value))
REFUSE(fmi2GetStringStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2String *value))
