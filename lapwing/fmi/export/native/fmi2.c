/* FMI 2.0 co-simulation. Signatures follow the standard; unused functions return an error. */
#define fmi_get_state fmi2GetFMUstate
#define fmi_set_state fmi2SetFMUstate
#define fmi_free_state fmi2FreeFMUstate
#define fmi_serialized_state_size fmi2SerializedFMUstateSize
#define fmi_serialize_state fmi2SerializeFMUstate
#define fmi_deserialize_state fmi2DeSerializeFMUstate
#include "fmi_common.h"

typedef struct {
    void (*logger)(void *environment, const char *name, int status, const char *category, const char *message, ...);
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*finished)(void *environment, int status);
    void *environment;
} callbacks;

static void report(void *instance_, int status, const char *category, const char *message) {
    instance *self = instance_;
    const callbacks *functions = self->logger;
    if (functions && functions->logger && (self->logging || status >= ERROR))
        functions->logger(functions->environment, self->name, status, category, "%s", message);
}

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }

API int fmi2SetDebugLogging(void *self, int on, size_t count, const char *const categories[]) {
    (void)count, (void)categories;
    ((instance *)self)->logging = on;
    return OK;
}

API void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                          const callbacks *functions, int visible, int logging) {
    (void)resources, (void)visible;
    instance *self = type == 1 ? new_instance(name, token) : NULL;
    if (!self) {
        if (functions && functions->logger)
            functions->logger(functions->environment, name, ERROR, "logStatusError",
                              "wrong GUID or type; this FMU is for co-simulation");
        return NULL;
    }
    self->logger = (void *)functions, self->logging = logging;
    return self;
}

API void fmi2FreeInstance(void *self) { free_instance(self); }

API int fmi2SetupExperiment(void *self_, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    instance *self = self_;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    if (!isfinite(start)) return fail(self, "initialisation: start time %g; use a finite time", start);
    self->start = self->time = start;
    return OK;
}

API int fmi2EnterInitializationMode(void *self_) {
    instance *self = self_;
    if (self->mode != INSTANTIATED) return fail(self, "initialisation: not possible now; reset the instance first");
    self->mode = INITIALIZATION;
    return OK;
}

API int fmi2ExitInitializationMode(void *self_) {
    instance *self = self_;
    if (self->mode != INITIALIZATION) return fail(self, "initialisation: was not entered");
    return initialise(self);
}

API int fmi2Terminate(void *self) {
    ((instance *)self)->mode = TERMINATED;
    return OK;
}
API int fmi2Reset(void *self) { return reset_instance(self); }
API int fmi2DoStep(void *self, double from, double step, int no_earlier_state) {
    (void)no_earlier_state;
    return step_to(self, from, step, NULL);
}
API int fmi2CancelStep(void *self) { return fail(self, "cancelStep: steps are never pending"); }

#define ACCESS(Type, c_type, kind, from_double)                                                           \
    API int fmi2Get##Type(void *self, const uint32_t references[], size_t count, c_type values[]) {       \
        for (size_t i = 0; i < count; i++) {                                                              \
            double x;                                                                                     \
            if (get_number(self, references[i], kind, &x)) return ERROR;                                  \
            values[i] = from_double;                                                                      \
        }                                                                                                 \
        return OK;                                                                                        \
    }                                                                                                     \
    API int fmi2Set##Type(void *self, const uint32_t references[], size_t count, const c_type values[]) { \
        for (size_t i = 0; i < count; i++)                                                                \
            if (set_number(self, references[i], kind, (double)values[i])) return ERROR;                   \
        return OK;                                                                                        \
    }
ACCESS(Real, double, REAL, x)
ACCESS(Integer, int32_t, INTEGER, x >= -2147483648.0 && x <= 2147483647.0 ? (int32_t)x : INT32_MIN)
ACCESS(Boolean, int32_t, BOOLEAN, x != 0)

enum { DO_STEP_STATUS, PENDING, LAST_SUCCESSFUL_TIME, TERMINATED_STATUS };
API int fmi2GetRealStatus(void *self, int kind, double *value) {
    if (kind != LAST_SUCCESSFUL_TIME) return DISCARD;
    *value = ((instance *)self)->time;
    return OK;
}
API int fmi2GetBooleanStatus(void *self, int kind, int *value) {
    if (kind != TERMINATED_STATUS) return DISCARD;
    *value = (int)STATE(((instance *)self)->memory)->finished;
    return OK;
}

#define UNSUPPORTED(name) \
    API int name(void) { return ERROR; }
UNSUPPORTED(fmi2GetString) UNSUPPORTED(fmi2SetString) UNSUPPORTED(fmi2GetDirectionalDerivative)
UNSUPPORTED(fmi2SetRealInputDerivatives) UNSUPPORTED(fmi2GetRealOutputDerivatives) UNSUPPORTED(fmi2GetStatus)
UNSUPPORTED(fmi2GetIntegerStatus) UNSUPPORTED(fmi2GetStringStatus)
