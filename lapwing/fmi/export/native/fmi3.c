/* FMI 3.0 co-simulation. Signatures follow the standard; unused functions return an error. */
#define fmi_get_state fmi3GetFMUState
#define fmi_set_state fmi3SetFMUState
#define fmi_free_state fmi3FreeFMUState
#define fmi_serialized_state_size fmi3SerializedFMUStateSize
#define fmi_serialize_state fmi3SerializeFMUState
#define fmi_deserialize_state fmi3DeserializeFMUState
#include "fmi_common.h"

typedef void log_message(void *environment, int status, const char *category, const char *message);

static void report(void *instance_, int status, const char *category, const char *message) {
    instance *self = instance_;
    if (self->logger && (self->logging || status >= ERROR))
        ((log_message *)self->logger)(self->environment, status, category, message);
}

API const char *fmi3GetVersion(void) { return "3.0"; }

API int fmi3SetDebugLogging(void *self, uint8_t on, size_t count, const char *const categories[]) {
    (void)count, (void)categories;
    ((instance *)self)->logging = on;
    return OK;
}

API void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, uint8_t visible,
                                      uint8_t logging, uint8_t event_mode, uint8_t early_return,
                                      const uint32_t intermediate[], size_t count, void *environment,
                                      log_message *logger, void *intermediate_update) {
    (void)resources, (void)visible, (void)intermediate, (void)count, (void)intermediate_update;
    instance *self = new_instance(name, token);
    if (!self) {
        if (logger) logger(environment, ERROR, "logStatusError", "instantiation token differs from that of this FMU");
        return NULL;
    }
    self->environment = environment, self->logger = (void *)logger, self->logging = logging;
    self->event_mode = event_mode, self->early_return = event_mode && early_return;
    return self;
}

API void *fmi3InstantiateModelExchange(void) { return NULL; }
API void *fmi3InstantiateScheduledExecution(void) { return NULL; }
API void fmi3FreeInstance(void *self) { free_instance(self); }

API int fmi3EnterInitializationMode(void *self_, uint8_t has_tolerance, double tolerance, double start, uint8_t has_stop,
                                    double stop) {
    instance *self = self_;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    if (self->mode != INSTANTIATED) return fail(self, "initialisation: not possible now; reset the instance first");
    if (!isfinite(start)) return fail(self, "initialisation: start time %g; use a finite time", start);
    self->start = self->time = start;
    self->mode = INITIALIZATION;
    return OK;
}

API int fmi3ExitInitializationMode(void *self_) {
    instance *self = self_;
    if (self->mode != INITIALIZATION) return fail(self, "initialisation: was not entered");
    int status = initialise(self);
    if (status == OK && self->event_mode) self->mode = EVENT;
    return status;
}

API int fmi3EnterEventMode(void *self) {
    if (((instance *)self)->mode != STEP) return fail(self, "event mode: not possible now");
    ((instance *)self)->mode = EVENT;
    return OK;
}

API int fmi3EnterStepMode(void *self) {
    if (((instance *)self)->mode != EVENT) return fail(self, "step mode: not possible now");
    ((instance *)self)->mode = STEP;
    return OK;
}

API int fmi3UpdateDiscreteStates(void *self, uint8_t *again, uint8_t *terminate, uint8_t *nominals, uint8_t *states,
                                 uint8_t *has_event, double *event_time) {
    *again = *nominals = *states = 0;
    *terminate = (uint8_t)STATE(((instance *)self)->memory)->finished;
    *has_event = (uint8_t)next_failure(self, event_time);
    return OK;
}
API int fmi3EvaluateDiscreteStates(void *self) { return (void)self, OK; }

API int fmi3Terminate(void *self) {
    ((instance *)self)->mode = TERMINATED;
    return OK;
}
API int fmi3Reset(void *self) { return reset_instance(self); }

API int fmi3DoStep(void *self_, double from, double step, uint8_t no_earlier_state, uint8_t *event, uint8_t *terminate,
                   uint8_t *early, double *reached) {
    instance *self = self_;
    (void)no_earlier_state;
    int contact = 0;
    int status = step_to(self, from, step, self->event_mode ? &contact : NULL);
    *event = (uint8_t)contact;
    *terminate = status == OK && STATE(self->memory)->finished;
    *early = status == OK && self->time < from + step;
    *reached = self->time;
    return status;
}

#define ACCESS(Type, c_type, kind, from_double)                                                                        \
    API int fmi3Get##Type(void *self, const uint32_t references[], size_t count, c_type values[], size_t size) {       \
        if (size != count) return fail(self, "%zu values for %zu scalar variables", size, count);                      \
        for (size_t i = 0; i < count; i++) {                                                                           \
            double x;                                                                                                  \
            if (get_number(self, references[i], kind, &x)) return ERROR;                                               \
            values[i] = from_double;                                                                                   \
        }                                                                                                              \
        return OK;                                                                                                     \
    }                                                                                                                  \
    API int fmi3Set##Type(void *self, const uint32_t references[], size_t count, const c_type values[], size_t size) { \
        if (size != count) return fail(self, "%zu values for %zu scalar variables", size, count);                      \
        for (size_t i = 0; i < count; i++)                                                                             \
            if (set_number(self, references[i], kind, (double)values[i])) return ERROR;                                \
        return OK;                                                                                                     \
    }
ACCESS(Float64, double, REAL, x)
ACCESS(Int32, int32_t, INTEGER, x >= -2147483648.0 && x <= 2147483647.0 ? (int32_t)x : INT32_MIN)
ACCESS(Boolean, uint8_t, BOOLEAN, x != 0)

#define UNSUPPORTED(name) \
    API int name(void) { return ERROR; }
UNSUPPORTED(fmi3GetFloat32) UNSUPPORTED(fmi3SetFloat32) UNSUPPORTED(fmi3GetInt8) UNSUPPORTED(fmi3SetInt8)
UNSUPPORTED(fmi3GetUInt8) UNSUPPORTED(fmi3SetUInt8) UNSUPPORTED(fmi3GetInt16) UNSUPPORTED(fmi3SetInt16)
UNSUPPORTED(fmi3GetUInt16) UNSUPPORTED(fmi3SetUInt16) UNSUPPORTED(fmi3GetUInt32) UNSUPPORTED(fmi3SetUInt32)
UNSUPPORTED(fmi3GetInt64) UNSUPPORTED(fmi3SetInt64) UNSUPPORTED(fmi3GetUInt64) UNSUPPORTED(fmi3SetUInt64)
UNSUPPORTED(fmi3GetString) UNSUPPORTED(fmi3SetString) UNSUPPORTED(fmi3GetBinary) UNSUPPORTED(fmi3SetBinary)
UNSUPPORTED(fmi3GetClock) UNSUPPORTED(fmi3SetClock) UNSUPPORTED(fmi3GetNumberOfVariableDependencies)
UNSUPPORTED(fmi3GetVariableDependencies) UNSUPPORTED(fmi3GetDirectionalDerivative)
UNSUPPORTED(fmi3GetAdjointDerivative) UNSUPPORTED(fmi3EnterConfigurationMode)
UNSUPPORTED(fmi3ExitConfigurationMode) UNSUPPORTED(fmi3GetIntervalDecimal) UNSUPPORTED(fmi3GetIntervalFraction)
UNSUPPORTED(fmi3GetShiftDecimal) UNSUPPORTED(fmi3GetShiftFraction) UNSUPPORTED(fmi3SetIntervalDecimal)
UNSUPPORTED(fmi3SetIntervalFraction) UNSUPPORTED(fmi3SetShiftDecimal) UNSUPPORTED(fmi3SetShiftFraction)
UNSUPPORTED(fmi3EnterContinuousTimeMode) UNSUPPORTED(fmi3CompletedIntegratorStep) UNSUPPORTED(fmi3SetTime)
UNSUPPORTED(fmi3SetContinuousStates) UNSUPPORTED(fmi3GetContinuousStateDerivatives)
UNSUPPORTED(fmi3GetEventIndicators) UNSUPPORTED(fmi3GetContinuousStates)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates) UNSUPPORTED(fmi3GetNumberOfEventIndicators)
UNSUPPORTED(fmi3GetNumberOfContinuousStates) UNSUPPORTED(fmi3GetOutputDerivatives)
UNSUPPORTED(fmi3ActivateModelPartition)
