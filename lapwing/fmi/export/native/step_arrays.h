/* Arrays that compiled blocks create within a step: a stack in the frame of part_advance, so that no step uses the
   heap. Included by runtime.c. */

#define ARRAY_ALIGNMENT 64

typedef struct step_array { /* numba's MemInfo; compiled code does not read the last word */
    int64_t references;     /* 0: released, but below an array in use */
    void *destructor, *argument, *data;
    size_t size;
    struct step_array *below;
} step_array;

static _Thread_local struct {
    unsigned char *free, *end;
    step_array *top; /* newest array; NULL if there is none */
} arrays;

static void arrays_begin(unsigned char *memory, size_t size) {
    arrays.free = memory, arrays.end = memory + size, arrays.top = NULL;
}

void *NRT_MemInfo_alloc_aligned(size_t size, uint32_t alignment) {
    (void)alignment;
    size_t padding = -(uintptr_t)arrays.free % ARRAY_ALIGNMENT;
    size_t needed = padding + ARRAY_ALIGNMENT + size; /* the first part has the step_array */
    if (size > ARRAYS || needed > (size_t)(arrays.end - arrays.free)) return NULL;
    step_array *self = (step_array *)(arrays.free + padding);
    *self = (step_array){1, NULL, NULL, (char *)self + ARRAY_ALIGNMENT, size, arrays.top};
    arrays.top = self, arrays.free += needed;
    return self;
}

void NRT_MemInfo_call_dtor(void *array) {
    ((step_array *)array)->references = 0;
    for (; arrays.top && !arrays.top->references; arrays.top = arrays.top->below)
        arrays.free = (unsigned char *)arrays.top;
}

/* Compute the strides of a contiguous array in a new shape. Return 0 if it has another size or is not contiguous. */
int numba_attempt_nocopy_reshape(int64_t n, const int64_t shape[], const int64_t strides[], int64_t new_n,
                                 const int64_t new_shape[], int64_t new_strides[], int64_t item, int fortran) {
    int64_t step = item, new_step = item;
    for (int64_t i = n - 1; i >= 0; step *= shape[i--])
        if (fortran || (shape[i] != 1 && strides[i] != step)) return 0;
    for (int64_t i = new_n - 1; i >= 0; new_step *= new_shape[i--]) new_strides[i] = new_step;
    return step == new_step;
}
