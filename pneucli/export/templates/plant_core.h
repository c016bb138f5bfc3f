/* Plant of the pipeline @PIPELINE@, written by pneucli @VERSION@, for whatever version of FMI includes it: before it stand
   the type Log and tell(log, environment, message). The functions in plant_model.h are translated from the equations of
   the simulation. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TOKEN "@TOKEN@"
enum {
    N_INPUTS = 4, N_OUTPUTS = 9, N_BASE = @N_BASE@, N_TH = @N_TH@, N_START = 6, N_STATES = @N_STATES@,
    N_EFFECTS = @N_EFFECTS@, RING_ROWS = @RING_ROWS@, RING_COLUMNS = 5, TABLE_POINTS = @TABLE_POINTS@,
    TH = N_BASE, START = TH + N_TH, H_MAX = START + N_START, AREA_FACTOR_1 = H_MAX + 1, AREA_FACTOR_2 = H_MAX + 2,
    N_VALUES = H_MAX + 3, LOWER_END = @LOWER_END@, UPPER_END = @UPPER_END@
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
    double s[N_STATES], s1[2 * N_EFFECTS], s2[2 * N_EFFECTS], s_supply[N_EFFECTS];
    double ring[RING_ROWS * RING_COLUMNS];
} Plant;

typedef struct {
    Plant plant;
    double areas_1[TABLE_POINTS], areas_2[TABLE_POINTS]; /* with their factors */
    int exchanges; /* whether it was instantiated for model exchange */
    Log log;
    void *environment;
} Instance;

enum { DONE = 0, FAILED = 3 }; /* as OK and Error of FMI */

static int fail(const Instance *instance, const char *message)
{
    if (instance->log != NULL) {
        tell(instance->log, instance->environment, message);
    }
    return FAILED;
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
    plant_start(plant->values + START, plant->inputs, FLAGS, plant->s, plant->s1, plant->s2, plant->s_supply, plant->ring,
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

static Instance *instantiate(const char *token, void *environment, Log log, int exchanges)
{
    Instance *instance;
    if (token == NULL || strcmp(token, TOKEN) != 0) {
        if (log != NULL) {
            tell(log, environment, "the instantiation token is that of another FMU");
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

static void begin(Instance *own, double time)
{
    own->plant.time = time;
    own->plant.now = time;
    own->plant.mode = INITIALIZATION;
}

static int finish_initialization(Instance *own)
{
    Plant *plant = &own->plant;
    const double *values = plant->values;
    if (values[START] != VALUES[START] && (values[START] < values[LOWER_END] || values[START] > values[UPPER_END])) {
        return fail(own, "start.x is beyond an end of the stroke");
    }
    start(plant);
    scale_tables(own);
    plant->mode = STEP;
    return is_finite_state(plant) ? DONE : fail(own, "the start values give no finite state");
}

/* Variables */

static int get_values(Instance *own, const unsigned int vr[], size_t n, double values[])
{
    Plant *plant = &own->plant;
    double outputs[N_OUTPUTS];
    size_t i;
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
    return DONE;
}

static int set_parameter(Instance *own, int place, double value)
{
    char message[200];
    if (own->plant.mode > INITIALIZATION) {
        return fail(own, "a parameter can be set before the end of the initialization only");
    }
    if (value < LOWEST[place] || value > HIGHEST[place]) {
        int low = value < LOWEST[place];
        snprintf(message, sizeof message, "%s = %.9g is too %s: it must be at %s %.9g", NAMES[place], value,
                 low ? "small" : "large", low ? "least" : "most", low ? LOWEST[place] : HIGHEST[place]);
        return fail(own, message);
    }
    own->plant.values[place] = value;
    return DONE;
}

static int set_values(Instance *own, const unsigned int vr[], size_t n, const double values[])
{
    size_t i;
    int status = DONE;
    for (i = 0; i < n && status == DONE; ++i) {
        if (!isfinite(values[i])) {
            return fail(own, "a value is not finite");
        }
        if (vr[i] >= VR_INPUTS && vr[i] < VR_INPUTS + N_INPUTS) {
            own->plant.inputs[vr[i] - VR_INPUTS] = values[i];
        } else if (vr[i] >= VR_VALUES && vr[i] < VR_VALUES + N_VALUES) {
            status = set_parameter(own, (int)vr[i] - VR_VALUES, values[i]);
        } else {
            return fail(own, "this variable cannot be set");
        }
    }
    return status;
}

/* State */

static int get_state(const Instance *own, void **state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(Plant));
    }
    if (*state == NULL) {
        return fail(own, "no memory for the state");
    }
    memcpy(*state, &own->plant, sizeof(Plant));
    return DONE;
}

static int set_state(Instance *own, const void *state)
{
    memcpy(&own->plant, state, sizeof(Plant));
    scale_tables(own);
    return DONE;
}

static int free_state(void **state)
{
    free(*state);
    *state = NULL;
    return DONE;
}

static int serialize_state(const Instance *own, const void *state, void *bytes, size_t size)
{
    if (size < sizeof(Plant)) {
        return fail(own, "the serialized state does not fit");
    }
    memcpy(bytes, state, sizeof(Plant));
    return DONE;
}

static int deserialize_state(const Instance *own, const void *bytes, size_t size, void **state)
{
    if (size != sizeof(Plant)) {
        return fail(own, "the serialized state is that of another FMU");
    }
    if (*state == NULL) {
        *state = malloc(sizeof(Plant));
    }
    if (*state == NULL) {
        return fail(own, "no memory for the state");
    }
    memcpy(*state, bytes, sizeof(Plant));
    return DONE;
}

/* Steps */

/* Return whether the ring buffer has room for the steps of the next call: its writer must not overtake its reader. */
static int has_room(const Plant *plant, int tail)
{
    int free_rows = ((int)plant->s[tail] - (int)plant->s[K_AT_HEAD] + RING_ROWS) % RING_ROWS;
    return free_rows > MAX_SUBSTEPS + 1;
}

/* Advance the state by a step with held inputs. */
static int advance(Instance *own, const double inputs[], double time, double step)
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
    return DONE;
}

/* Model exchange: no state is continuous for the importer. The plant advances its own at events that are SAMPLE apart,
   with the inputs of the event before. */
static int take_event(Instance *own, double *next_event)
{
    Plant *plant = &own->plant;
    double step = plant->now - plant->time;
    if (!own->exchanges) {
        return fail(own, "this instance is for co-simulation: it has no events");
    }
    if (step > 1e-6 * SAMPLE) {
        if (fabs(step - SAMPLE) < 1e-6 * SAMPLE) {
            step = SAMPLE; /* but for rounding */
        }
        if (advance(own, plant->held, plant->time, step) != DONE) {
            return FAILED;
        }
        plant->time = plant->now;
    }
    memcpy(plant->held, plant->inputs, sizeof plant->held);
    *next_event = plant->time + SAMPLE;
    return DONE;
}
