/* Steps the blocks of an exported part. An instance is one block of memory without pointers to other memory. */
#ifndef LAPWING_RUNTIME_H
#define LAPWING_RUNTIME_H

#include <stddef.h>
#include <stdint.h>

enum { PART_RUNNING, PART_FINISHED, PART_FAILED }; /* results of part_advance */

typedef int32_t step_function(int64_t *signal, void **error, void *cell, int64_t tick);

typedef struct {
    int64_t at, to; /* [bytes] offset of a pointer in the image, and of what it points to */
} relocation;

typedef struct {
    step_function *step; /* NULL: Python block, whose recorded writes are repeated */
    int64_t cell;        /* offset in the image */
    int64_t every;       /* [ticks] */
    int64_t vehicle;
    int64_t until, following; /* first tick of its replacement, after a propeller failure, and index of that block */
} block;

typedef struct {
    int64_t rows, depth, width; /* offset of the first row in the image; rows; columns */
    int64_t period, lag;        /* [ticks]; period 0: latched */
    int64_t staged;             /* index of the first staged number, of inputs */
} port;

typedef struct {
    int64_t tick, block;
    int64_t first, count; /* of the writes */
} action;

typedef struct {
    int64_t offset, data, size; /* in the image; in part_written; [bytes] */
} write_of;

enum { TIME, INPUT, OUTPUT, NUMBER }; /* where a variable is */
enum { REAL, INTEGER, BOOLEAN };

typedef struct {
    const char *name;
    uint8_t place, type, tunable;
    int32_t port;   /* index of an output port */
    int64_t offset; /* staged number, column of the port, or offset in the image */
} variable;

typedef struct {
    int64_t tick;   /* last computed; -1 before the first */
    int64_t cursor; /* next action */
    int64_t missed; /* wake-ups of Python blocks at ticks at which the recorded run had none */
    int64_t finished, failed;
    int64_t numbers[]; /* next[BLOCKS], done[VEHICLES], staged[STAGED] */
} part_state;

size_t part_size(void);
void part_reset(void *memory);    /* put the memory into the state before the first tick */
void part_relocate(void *memory); /* after memory was copied from another address */
void part_unlink(void *memory);   /* clear pointers, so that equal states have equal bytes */
int part_advance(void *memory);   /* compute the next tick */
double *part_staged(void *memory);
const double *part_row(const void *memory, int output); /* the newest row of an output port */
int part_number(const void *memory, uint32_t reference, double *value);  /* 0 on success */
int part_set_number(void *memory, uint32_t reference, double value);
int part_variable(const char *name); /* reference, -1 if unknown */

#define STATE(memory) ((part_state *)(memory))

#endif
