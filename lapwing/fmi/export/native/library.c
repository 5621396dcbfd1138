/* Functions of an exported library; see the generated header. */
#include <stdlib.h>
#include <string.h>

#include "runtime.h"
#include "tables.h"

#define JOIN_(a, b) a##_##b
#define JOIN(a, b) JOIN_(a, b)
#define NAME(name) JOIN(LAPWING_PREFIX, name)
#define API __attribute__((visibility("default")))

API size_t NAME(size)(void) { return part_size(); }
API void NAME(reset)(void *self) { part_reset(self); }
API void *NAME(new)(void) {
    void *self = aligned_alloc(64, (part_size() + 63) / 64 * 64);
    if (self) part_reset(self);
    return self;
}
API void NAME(free)(void *self) { free(self); }
API int NAME(advance)(void *self) { return part_advance(self); }
API int64_t NAME(tick)(const void *self) { return STATE(self)->tick; }
API int64_t NAME(missed)(const void *self) { return STATE(self)->missed; }
API void NAME(save)(const void *self, void *state) {
    memcpy(state, self, part_size());
    part_unlink(state);
}
API void NAME(load)(void *self, const void *state) {
    memcpy(self, state, part_size());
    part_relocate(self);
}
API void NAME(write)(void *self, int input, const void *sample) {
    memcpy(part_staged(self) + part_inputs[input].staged, sample, 8 * part_inputs[input].width);
}
API void NAME(read)(const void *self, int output, void *sample) {
    memcpy(sample, part_row(self, output), 8 * part_outputs[output].width);
}
API int NAME(find)(const char *name) { return part_variable(name); }
API int NAME(get)(const void *self, int reference, double *value) { return part_number(self, (uint32_t)reference, value); }
API int NAME(set)(void *self, int reference, double value) { return part_set_number(self, (uint32_t)reference, value); }
