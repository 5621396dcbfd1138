/* See runtime.h. tables.h is written by lapwing/fmi/export/c_tables.py. */
#include "runtime.h"

#include <string.h>

#include "tables.h"

#if ARRAYS
#include "step_arrays.h"
#endif

enum { CONTINUE, WAKE_PYTHON, FINISHED, NON_FINITE }; /* signals of lapwing/cosim/diagram/compiled_block.py */
enum { LATCHED };

#define NUMBERS (BLOCKS + VEHICLES + STAGED)
#define HEADER ((sizeof(part_state) + 8 * NUMBERS + 63) / 64 * 64)
#define IMAGE(memory) ((unsigned char *)(memory) + HEADER)
#define NEXT(s) ((s)->numbers)
#define DONE(s) ((s)->numbers + BLOCKS)

size_t part_size(void) { return HEADER + IMAGE_SIZE; }

double *part_staged(void *memory) { return (double *)(STATE(memory)->numbers + BLOCKS + VEHICLES); }

void part_relocate(void *memory) {
    unsigned char *image = IMAGE(memory);
    for (size_t i = 0; i < RELOCATIONS; i++) {
        unsigned char *to = image + part_relocations[i].to;
        memcpy(image + part_relocations[i].at, &to, sizeof to);
    }
}

void part_unlink(void *memory) {
    for (size_t i = 0; i < RELOCATIONS; i++) memset(IMAGE(memory) + part_relocations[i].at, 0, sizeof(void *));
}

void part_reset(void *memory) {
    memset(memory, 0, HEADER);
    memcpy(IMAGE(memory), PART_IMAGE, IMAGE_SIZE);
    part_relocate(memory);
    STATE(memory)->tick = -1;
    memcpy(part_staged(memory), part_start, sizeof part_start);
}

/* Row of the sample stamped `stamp`, -1 if none is due; as `due` and `row_of` of the block diagram. */
static int64_t row_at(const port *p, int64_t stamp) {
    if (stamp < 0) return -1;
    if (p->period == LATCHED) return 0;
    if (p->period == 1) return stamp & (p->depth - 1);
    return stamp % p->period ? -1 : (stamp / p->period) & (p->depth - 1);
}

static double *row(const void *memory, const port *p, int64_t index) {
    return (double *)(IMAGE(memory) + p->rows) + index * p->width;
}

const double *part_row(const void *memory, int output) {
    const port *p = &part_outputs[output];
    int64_t tick = STATE(memory)->tick;
    if (tick < 0) tick = 0;
    return row(memory, p, row_at(p, p->period > 1 ? tick - tick % p->period : tick));
}

static void apply(void *memory, const action *a) {
    for (int64_t i = a->first; i < a->first + a->count; i++)
        memcpy(IMAGE(memory) + part_writes[i].offset, part_written + part_writes[i].data, part_writes[i].size);
}

static void act(void *memory, int64_t tick, int64_t k, int woken) {
    part_state *s = STATE(memory);
    const action *a = &part_actions[s->cursor];
    if (s->cursor < ACTIONS && a->tick == tick && a->block == k) {
        apply(memory, a);
        s->cursor++;
    } else {
        s->missed += woken;
    }
}

int part_advance(void *memory) {
    part_state *s = STATE(memory);
    if (s->failed) return PART_FAILED;
#if ARRAYS
    unsigned char of_step[ARRAYS];
    arrays_begin(of_step, sizeof of_step);
#endif
    int64_t tick = s->tick + 1, woken = -1;
    for (size_t i = 0; i < INPUTS; i++) {
        const port *p = &part_inputs[i];
        int64_t at = row_at(p, tick - p->lag);
        if (at >= 0) memcpy(row(memory, p, at), part_staged(memory) + p->staged, 8 * p->width);
    }
    for (int64_t k = 0; k < BLOCKS; k++) {
        const block *b = &part_blocks[k];
        while (b->until <= tick) b = &part_blocks[b->following];
        if (!b->step) {
            act(memory, tick, k, woken == b->vehicle);
            continue;
        }
        if (NEXT(s)[k] > tick) continue;
        NEXT(s)[k] = tick + b->every;
        int64_t signal = CONTINUE;
        void *error = NULL;
        if (b->step(&signal, &error, IMAGE(memory) + b->cell, tick) != 0 || signal == NON_FINITE) {
            s->failed = 1;
            s->tick = tick;
            return PART_FAILED;
        }
        if (signal == FINISHED) DONE(s)[b->vehicle] = 1;
        if (signal == WAKE_PYTHON) woken = b->vehicle;
    }
    s->tick = tick;
    if (!s->finished) {
        s->finished = 1;
        for (size_t v = 0; v < VEHICLES; v++) s->finished &= DONE(s)[v];
    }
    return s->finished ? PART_FINISHED : PART_RUNNING;
}

int part_number(const void *memory, uint32_t reference, double *value) {
    if (reference >= VARIABLES) return 1;
    const variable *v = &part_variables[reference];
    if (v->place == INPUT)
        *value = part_staged((void *)memory)[v->offset];
    else if (v->place == OUTPUT)
        *value = part_row(memory, v->port)[v->offset];
    else if (v->place == NUMBER)
        memcpy(value, IMAGE(memory) + v->offset, sizeof *value);
    else
        *value = (STATE(memory)->tick < 0 ? 0 : STATE(memory)->tick) * PART_INTERVAL;
    return 0;
}

int part_set_number(void *memory, uint32_t reference, double value) {
    if (reference >= VARIABLES) return 1;
    const variable *v = &part_variables[reference];
    if (v->place == INPUT)
        part_staged(memory)[v->offset] = value;
    else if (v->place == NUMBER && (v->tunable || STATE(memory)->tick < 0))
        memcpy(IMAGE(memory) + v->offset, &value, sizeof value);
    else
        return 1;
    return 0;
}

int part_variable(const char *name) {
    for (int i = 0; i < VARIABLES; i++)
        if (!strcmp(part_variables[i].name, name)) return i;
    return -1;
}

/* What compiled blocks call: exact operations, so that no C library decides on their bits. */

double numba_frexp(double x, int *exponent) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    int e = (int)(bits >> 52 & 0x7ff);
    *exponent = 0;
    if (e == 0x7ff || !(bits << 1)) return x; /* not finite, or zero */
    if (e == 0) {                             /* subnormal */
        x *= 0x1p54;
        memcpy(&bits, &x, sizeof bits);
        e = (int)(bits >> 52 & 0x7ff) - 54;
    }
    *exponent = e - 1022;
    bits = (bits & 0x800fffffffffffffu) | (uint64_t)1022 << 52;
    memcpy(&x, &bits, sizeof x);
    return x;
}

#if !ARRAYS
void NRT_MemInfo_call_dtor(void *info) { (void)info; } /* memory of an instance is never released by a block */
#endif
void NRT_incref(void *info) { (void)info; }
void NRT_decref(void *info) { (void)info; }
