/* What FMI 2.0 and 3.0 functions share: time, modes and access to variables of one instance. */
#ifndef LAPWING_FMI_COMMON_H
#define LAPWING_FMI_COMMON_H

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "runtime.h"
#include "tables.h"
#include "token.h" /* INSTANTIATION_TOKEN */

#define API __attribute__((visibility("default")))
#define SLACK 1e-6 /* [ticks] of rounding in a time of the importer */
#define ROUNDINGS 4 /* of the largest time, in units of its last place */

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { INSTANTIATED, INITIALIZATION, STEP, EVENT, TERMINATED, FAILED };

typedef void log_function(void *instance, int status, const char *category, const char *message);

typedef struct {
    char *name;
    void *environment;
    void *logger;
    int logging, mode, event_mode, early_return;
    double start, time; /* [s] of the experiment; last communication point */
    int64_t warned;     /* 1 after the warning of events that the recorded run did not have */
    void *memory;
    void *first;        /* in initialisation mode: the memory after tick 0 with the inputs so far; NULL until read */
} instance;

static log_function report; /* defined by each version */

static int fail(instance *self, const char *format, ...) {
    char text[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    report(self, ERROR, "logStatusError", text);
    return ERROR;
}

static void *new_memory(void) { return aligned_alloc(64, (part_size() + 63) / 64 * 64); }

static void forget_first(instance *self) { free(self->first), self->first = NULL; }

static void free_instance(instance *self) {
    if (!self) return;
    forget_first(self);
    free(self->memory);
    free(self->name);
    free(self);
}

static instance *new_instance(const char *name, const char *token) {
    instance *self = calloc(1, sizeof *self);
    if (!self) return NULL;
    self->name = strdup(name ? name : "");
    self->memory = new_memory();
    if (!self->name || !self->memory || !token || strcmp(token, INSTANTIATION_TOKEN)) {
        free_instance(self);
        return NULL;
    }
    part_reset(self->memory);
    return self;
}

static int reset_instance(instance *self) {
    forget_first(self);
    part_reset(self->memory);
    self->mode = INSTANTIATED, self->warned = 0;
    return OK;
}

static int advance_one(instance *self) {
    if (part_advance(self->memory) == PART_FAILED) {
        self->mode = FAILED;
        return fail(self, "t = %g s: the state is not finite; check the inputs, or reset", self->time);
    }
    if (STATE(self->memory)->missed && !self->warned) {
        report(self, WARNING, "logStatusWarning",
               "an event occurred that the recorded run of the scene did not have; the flight manager repeats its "
               "recorded commands and does not react");
        self->warned = 1;
    }
    return OK;
}

static int initialise(instance *self) {
    forget_first(self);
    self->time = self->start;
    self->mode = STEP;
    return advance_one(self);
}

/* Number of the last tick that is not after a time. A late start, such as Unix time, has coarse times, and an importer
   that adds its steps has rounded once a tick. */
static int64_t tick_at(const instance *self, double time) {
    double largest = fabs(time) > fabs(self->start) ? fabs(time) : fabs(self->start);
    double ticks = (time - self->start) / PART_INTERVAL;
    double slack = SLACK + DBL_EPSILON * largest / PART_INTERVAL * (ROUNDINGS + (ticks > 0 ? ticks : 0));
    ticks += slack < 0.5 ? slack : 0.5;
    return ticks > 0 ? ticks < 9e15 ? (int64_t)ticks : INT64_MAX : 0;
}

static double contacts(const instance *self) {
    double sum = 0, value;
    for (size_t k = 0; k < EVENTS; k++)
        if (!part_number(self->memory, part_events[k], &value)) sum += value * (1 << k % 30);
    return sum;
}

static int is_failure(int64_t tick) {
    for (size_t k = 0; k < FAILURES; k++)
        if (part_failures[k] == tick) return 1;
    return 0;
}

/* Return 1 and the time [s] of the next propeller failure, 0 if none follows. */
static int next_failure(const instance *self, double *time) {
    for (size_t k = 0; k < FAILURES; k++)
        if (part_failures[k] > STATE(self->memory)->tick) {
            *time = self->start + part_failures[k] * PART_INTERVAL;
            return 1;
        }
    return 0;
}

/* Step to the end of a communication step. *event: a ground contact changed or a propeller failed, and the step may end
   early. */
static int step_to(instance *self, double from, double step, int *event) {
    if (self->mode != STEP) return fail(self, "doStep: not in step mode; initialise the instance first");
    if (!(step >= 0) || !isfinite(from) || !isfinite(step) || step > 1e9)
        return fail(self, "doStep: communication step %g s at %g s; use finite numbers, and a step of at least 0", step, from);
    if (fabs(from - self->time) > SLACK * PART_INTERVAL + 1e-9 * fabs(from))
        return fail(self, "doStep: starts at %g s, but the last step ended at %g s; continue there", from, self->time);
    int64_t last = tick_at(self, from + step);
    double before = event ? contacts(self) : 0;
    while (STATE(self->memory)->tick < last) {
        if (advance_one(self) != OK) return ERROR;
        self->time = self->start + STATE(self->memory)->tick * PART_INTERVAL;
        if (event && (is_failure(STATE(self->memory)->tick) || contacts(self) != before)) {
            *event = 1;
            if (STATE(self->memory)->tick < last && self->early_return) return OK;
        }
    }
    self->time = from + step;
    return OK;
}

/* Return the memory with the outputs. Initialisation mode needs those of tick 0 before it is left. */
static const void *outputs(instance *self) {
    if (self->mode != INITIALIZATION) return self->memory;
    if (!self->first && (self->first = new_memory())) {
        memcpy(self->first, self->memory, part_size());
        part_relocate(self->first);
        part_advance(self->first);
    }
    return self->first ? self->first : self->memory;
}

static int get_number(instance *self, uint32_t reference, int type, double *value) {
    if (reference < VARIABLES && part_variables[reference].type == type) {
        const void *memory = part_variables[reference].place == OUTPUT ? outputs(self) : self->memory;
        part_number(memory, reference, value);
        if (part_variables[reference].place == TIME) *value = self->time;
        return OK;
    }
    return fail(self, "value reference %u: no variable of this type; see modelDescription.xml", (unsigned)reference);
}

static int set_number(instance *self, uint32_t reference, int type, double value) {
    if (reference >= VARIABLES || part_variables[reference].type != type)
        return fail(self, "value reference %u: no variable of this type; see modelDescription.xml", (unsigned)reference);
    if (part_set_number(self->memory, reference, value))
        return fail(self, "%s: cannot be set now; set an input, a parameter, or a start value before initialisation",
                    part_variables[reference].name);
    forget_first(self);
    return OK;
}

/* A saved state: the memory without pointers, behind a header that names the model. */
typedef struct {
    char token[48];
    int64_t size, mode;
    double start, time;
    int64_t warned;
} saved_header;

static size_t saved_size(void) { return sizeof(saved_header) + part_size(); }

static void save(const instance *self, void *state) {
    saved_header header = {.size = (int64_t)part_size(), .mode = self->mode, .start = self->start, .time = self->time};
    header.warned = self->warned;
    strncpy(header.token, INSTANTIATION_TOKEN, sizeof header.token - 1);
    memcpy(state, &header, sizeof header);
    memcpy((char *)state + sizeof header, self->memory, part_size());
    part_unlink((char *)state + sizeof header);
}

static int is_saved(const void *state, size_t size) {
    saved_header header;
    if (!state || size != saved_size()) return 0;
    memcpy(&header, state, sizeof header);
    return header.size == (int64_t)part_size() && !strncmp(header.token, INSTANTIATION_TOKEN, sizeof header.token);
}

static void load(instance *self, const void *state) {
    saved_header header;
    forget_first(self);
    memcpy(&header, state, sizeof header);
    self->mode = (int)header.mode, self->start = header.start, self->time = header.time, self->warned = header.warned;
    memcpy(self->memory, (const char *)state + sizeof header, part_size());
    part_relocate(self->memory);
}

/* Functions of the standard; each version defines their names. */
API int fmi_get_state(void *self, void **state) {
    if (!*state && !(*state = malloc(saved_size()))) return fail(self, "not enough memory for a state");
    save(self, *state);
    return OK;
}
API int fmi_set_state(void *self, void *state) {
    if (!is_saved(state, saved_size())) return fail(self, "the state is not one of this FMU");
    load(self, state);
    return OK;
}
API int fmi_free_state(void *self, void **state) {
    (void)self;
    if (state) free(*state), *state = NULL;
    return OK;
}
API int fmi_serialized_state_size(void *self, void *state, size_t *size) {
    (void)self, (void)state;
    *size = saved_size();
    return OK;
}
API int fmi_serialize_state(void *self, void *state, uint8_t bytes[], size_t size) {
    if (!is_saved(state, size)) return fail(self, "the state is not one of this FMU");
    memcpy(bytes, state, size);
    return OK;
}
API int fmi_deserialize_state(void *self, const uint8_t bytes[], size_t size, void **state) {
    if (!is_saved(bytes, size)) return fail(self, "the bytes are not a state of this FMU");
    if (!*state && !(*state = malloc(size))) return fail(self, "not enough memory for a state");
    memcpy(*state, bytes, size);
    return OK;
}

#endif
