/* Plant of the pipeline @PIPELINE@ as an FMU (FMI 3.0, co-simulation and model exchange), written by pneucli @VERSION@.
   The functions in plant_model.h are translated from the equations of the simulation. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

#define TOKEN "@TOKEN@"
enum {
    N_INPUTS = 4, N_OUTPUTS = 9, N_BASE = @N_BASE@, N_TH = @N_TH@, N_START = 6, N_STATES = @N_STATES@,
    N_EFFECTS = @N_EFFECTS@, RING_ROWS = @RING_ROWS@, RING_COLUMNS = 5, TABLE_POINTS = @TABLE_POINTS@,
    TH = N_BASE, START = TH + N_TH, H_MAX = START + N_START, AREA_FACTOR_1 = H_MAX + 1, AREA_FACTOR_2 = H_MAX + 2,
    N_VALUES = H_MAX + 3
};
enum { VR_TIME = 0, VR_INPUTS = 1, VR_OUTPUTS = 11, VR_VALUES = 100 };
static const double SAMPLE = @SAMPLE@; /* s, between the events of model exchange */
enum { MAX_SUBSTEPS = 64 }; /* of one call of plant_step: a ring holds more of them */

static double smaller(double a, double b)
{
    return b < a ? b : a;
}

static double larger(double a, double b)
{
    return b > a ? b : a;
}

#include "plant_model.h"
#include "plant_tables.h"

typedef enum { INSTANTIATED, INITIALIZATION, STEP, TERMINATED } Mode;

/* all that changes: getting and setting the state of the FMU copies it */
typedef struct {
    Mode mode;
    double time;             /* of the state */
    double now;              /* of the importer's solver, in model exchange */
    double inputs[N_INPUTS];
    double held[N_INPUTS];   /* inputs at the last event of model exchange */
    double values[N_VALUES];
    double s[N_STATES], s1[N_EFFECTS], s2[N_EFFECTS], s_supply[N_EFFECTS];
    double ring[RING_ROWS * RING_COLUMNS];
} Plant;

typedef struct {
    Plant plant;
    double areas_1[TABLE_POINTS], areas_2[TABLE_POINTS]; /* with their factors */
    int exchanges; /* whether it was instantiated for model exchange */
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} Instance;

static fmi3Status fail(const Instance *instance, const char *message)
{
    if (instance->log != NULL) {
        instance->log(instance->environment, fmi3Error, "logStatusError", message);
    }
    return fmi3Error;
}

static void reset(Plant *plant)
{
    memset(plant, 0, sizeof *plant);
    memcpy(plant->values, VALUES, sizeof VALUES);
    memcpy(plant->inputs, INPUTS, sizeof INPUTS);
    plant->mode = INSTANTIATED;
}

static void start(Plant *plant)
{
    plant_start(plant->values + START, FLAGS, plant->s, plant->s1, plant->s2, plant->s_supply, plant->ring,
                plant->values, plant->values + TH, ON);
}

static void scale_tables(Instance *instance)
{
    int i;
    for (i = 0; i < TABLE_POINTS; ++i) {
        instance->areas_1[i] = AREAS_1[i] * instance->plant.values[AREA_FACTOR_1];
        instance->areas_2[i] = AREAS_2[i] * instance->plant.values[AREA_FACTOR_2];
    }
}

static int is_finite_state(const Plant *plant)
{
    int i;
    for (i = 0; i < N_STATES; ++i) {
        if (!isfinite(plant->s[i])) {
            return 0;
        }
    }
    return 1;
}

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

static fmi3Instance instantiate(
    fmi3String token, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, int exchanges)
{
    Instance *instance;
    if (token == NULL || strcmp(token, TOKEN) != 0) {
        if (log != NULL) {
            log(environment, fmi3Error, "logStatusError", "the instantiation token is that of another FMU");
        }
        return NULL;
    }
    instance = malloc(sizeof *instance);
    if (instance != NULL) {
        reset(&instance->plant);
        instance->log = log;
        instance->environment = environment;
        instance->exchanges = exchanges;
    }
    return instance;
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
    Plant *plant = &((Instance *)instance)->plant;
    (void)tolerance_defined; (void)tolerance; (void)stop_time_defined; (void)stop_time;
    plant->time = start_time;
    plant->now = start_time;
    plant->mode = INITIALIZATION;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    Instance *own = instance;
    start(&own->plant);
    scale_tables(own);
    own->plant.mode = STEP;
    return is_finite_state(&own->plant) ? fmi3OK : fail(own, "the start values give no finite state");
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
    Instance *own = instance;
    Plant *plant = &own->plant;
    double outputs[N_OUTPUTS];
    size_t i;
    if (n != n_vr) {
        return fail(own, "as many values as value references are needed");
    }
    if (plant->mode < STEP) {
        start(plant); /* parameters and start values may have changed */
    }
    plant_outputs(plant->inputs, FLAGS, plant->s, plant->values, plant->values + TH, ON, outputs);
    for (i = 0; i < n; ++i) {
        if (vr[i] == VR_TIME) {
            values[i] = own->exchanges ? plant->now : plant->time;
        } else if (vr[i] >= VR_INPUTS && vr[i] < VR_INPUTS + N_INPUTS) {
            values[i] = plant->inputs[vr[i] - VR_INPUTS];
        } else if (vr[i] >= VR_OUTPUTS && vr[i] < VR_OUTPUTS + N_OUTPUTS) {
            values[i] = outputs[vr[i] - VR_OUTPUTS];
        } else if (vr[i] >= VR_VALUES && vr[i] < VR_VALUES + N_VALUES) {
            values[i] = plant->values[vr[i] - VR_VALUES];
        } else {
            return fail(own, "no variable has this value reference");
        }
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr,
                          const fmi3Float64 values[], size_t n)
{
    Instance *own = instance;
    Plant *plant = &own->plant;
    size_t i;
    if (n != n_vr) {
        return fail(own, "as many values as value references are needed");
    }
    for (i = 0; i < n; ++i) {
        if (!isfinite(values[i])) {
            return fail(own, "a value is not finite");
        }
        if (vr[i] >= VR_INPUTS && vr[i] < VR_INPUTS + N_INPUTS) {
            plant->inputs[vr[i] - VR_INPUTS] = values[i];
        } else if (vr[i] >= VR_VALUES && vr[i] < VR_VALUES + N_VALUES) {
            if (plant->mode > INITIALIZATION) {
                return fail(own, "a parameter can be set before the end of the initialization only");
            }
            plant->values[vr[i] - VR_VALUES] = values[i];
        } else {
            return fail(own, "this variable cannot be set");
        }
    }
    return fmi3OK;
}

#define NONE(KIND)                                                                                               \
    fmi3Status fmi3Get##KIND(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr,                  \
                             fmi3##KIND values[], size_t n)                                                      \
    {                                                                                                            \
        (void)vr; (void)n_vr; (void)values;                                                                      \
        return n == 0 ? fmi3OK : fail(instance, "no variable has this type");                                    \
    }                                                                                                            \
    fmi3Status fmi3Set##KIND(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr,                  \
                             const fmi3##KIND values[], size_t n)                                                \
    {                                                                                                            \
        (void)vr; (void)n_vr; (void)values;                                                                      \
        return n == 0 ? fmi3OK : fail(instance, "no variable has this type");                                    \
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
    return n == 0 ? fmi3OK : fail(instance, "no variable has this type");
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr, const size_t sizes[],
                         const fmi3Binary values[], size_t n)
{
    (void)vr; (void)n_vr; (void)sizes; (void)values;
    return n == 0 ? fmi3OK : fail(instance, "no variable has this type");
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr, fmi3Clock values[])
{
    (void)vr; (void)values;
    return n_vr == 0 ? fmi3OK : fail(instance, "there are no clocks");
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr, const fmi3Clock values[])
{
    (void)vr; (void)values;
    return n_vr == 0 ? fmi3OK : fail(instance, "there are no clocks");
}

/* State */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(Plant));
    }
    if (*state == NULL) {
        return fail(instance, "no memory for the state");
    }
    memcpy(*state, &((Instance *)instance)->plant, sizeof(Plant));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    Instance *own = instance;
    memcpy(&own->plant, state, sizeof(Plant));
    scale_tables(own);
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    (void)instance; (void)state;
    *size = sizeof(Plant);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    if (size < sizeof(Plant)) {
        return fail(instance, "the serialized state does not fit");
    }
    memcpy(bytes, state, sizeof(Plant));
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    if (size != sizeof(Plant)) {
        return fail(instance, "the serialized state is that of another FMU");
    }
    if (*state == NULL) {
        *state = malloc(sizeof(Plant));
    }
    if (*state == NULL) {
        return fail(instance, "no memory for the state");
    }
    memcpy(*state, bytes, sizeof(Plant));
    return fmi3OK;
}

/* Co-simulation */

/* Return whether the ring buffer has room for the steps of the next call: its writer must not overtake its reader. */
static int has_room(const Plant *plant, int tail)
{
    int free_rows = ((int)plant->s[tail] - (int)plant->s[K_AT_HEAD] + RING_ROWS) % RING_ROWS;
    return free_rows > MAX_SUBSTEPS + 1;
}

/* Advance the state by a step with held inputs. */
static fmi3Status advance(Instance *own, const double inputs[], double time, double step)
{
    Plant *plant = &own->plant;
    double steps = ceil(step / plant->values[H_MAX]);
    int calls = (int)ceil(steps / MAX_SUBSTEPS), i;
    if (plant->mode != STEP) {
        return fail(own, "a step needs a finished initialization");
    }
    if (!(step > 0.0) || !(plant->values[H_MAX] > 0.0)) {
        return fail(own, "a step must be longer than 0 s");
    }
    for (i = 0; i < calls; ++i) {
        if (RING_ROWS > 1 && !(has_room(plant, K_AT_TAIL) && has_room(plant, K_AT_TAIL_2))) {
            return fail(own, "the hose delays the flow by more steps than it stores: take longer steps");
        }
        plant_step(time + i * (step / calls), step / calls, plant->values[H_MAX], inputs, FLAGS, own->areas_1,
                   own->areas_2, plant->s, plant->s1, plant->s2, plant->s_supply, plant->ring, plant->values,
                   plant->values + TH, ON);
    }
    if (!is_finite_state(plant)) {
        return fail(own, "the state is no longer finite: a parameter is out of its range");
    }
    plant->time = time + step;
    return fmi3OK;
}

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
    status = advance(own, own->plant.inputs, time, step);
    if (status == fmi3OK) {
        *last_time = own->plant.time;
    }
    return status;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference vr[], size_t n_vr,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t n)
{
    (void)vr; (void)n_vr; (void)orders; (void)values;
    return n == 0 ? fmi3OK : fail(instance, "there are no derivatives of outputs");
}

/* Model exchange: no state is continuous for the importer. The plant advances its own at events that are SAMPLE apart,
   with the inputs of the event before. */

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    ((Instance *)instance)->plant.now = time;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *needs_update, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed,
                                    fmi3Boolean *has_next_event, fmi3Float64 *next_event)
{
    Instance *own = instance;
    Plant *plant = &own->plant;
    double step = plant->now - plant->time;
    *needs_update = fmi3False;
    *terminate = fmi3False;
    *nominals_changed = fmi3False;
    *values_changed = fmi3False;
    if (!own->exchanges) {
        return fail(own, "this instance is for co-simulation: it has no events");
    }
    if (step > 1e-6 * SAMPLE) {
        if (fabs(step - SAMPLE) < 1e-6 * SAMPLE) {
            step = SAMPLE; /* but for rounding */
        }
        if (advance(own, plant->held, plant->time, step) != fmi3OK) {
            return fmi3Error;
        }
        plant->time = plant->now;
    }
    memcpy(plant->held, plant->inputs, sizeof plant->held);
    *has_next_event = fmi3True;
    *next_event = plant->time + SAMPLE;
    return fmi3OK;
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
    return n == 0 ? fmi3OK : fail(instance, "there are no continuous states");
}

#define NO_STATES(NAME)                                                                                          \
    fmi3Status NAME(fmi3Instance instance, fmi3Float64 values[], size_t n)                                       \
    {                                                                                                            \
        (void)values;                                                                                            \
        return n == 0 ? fmi3OK : fail(instance, "there are no continuous states");                               \
    }

NO_STATES(fmi3GetContinuousStates)
NO_STATES(fmi3GetContinuousStateDerivatives)
NO_STATES(fmi3GetNominalsOfContinuousStates)
NO_STATES(fmi3GetEventIndicators)

/* What this FMU does not offer */

#define REFUSE(NAME, ARGUMENTS)                                                                                  \
    fmi3Status NAME ARGUMENTS                                                                                    \
    {                                                                                                            \
        return fail(instance, #NAME " is not offered");                                                          \
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
