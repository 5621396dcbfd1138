/* Repeatable run of a firmware in the loop: equal inputs give equal outputs, whatever the load of the machine.
 *
 * Lapwing compiles this library, and preloads it (LD_PRELOAD) into a firmware that it starts. It replaces the functions
 * of the C library with which threads wait, read the clock, and exchange messages:
 *
 *   Threads   One thread runs at a time. It passes the turn on where it blocks: at a lock, a condition, a sleep, or a
 *             message. The next one is the next ready thread in the order of creation, or with a seed a random one.
 *             Lapwing starts the program on one core: messages of two sockets then arrive in the order of sending.
 *   Clock     All clocks show a virtual time. It moves by one step with each message of the link to the simulator,
 *             and, while there is no link, to the next deadline. With `read_ns` it also moves by this time at each
 *             reading and by each sleep, up to the time of the last message: for a firmware with a clock of its own.
 *   Inputs    The next message of the link, and other input, is taken only when all threads are blocked.
 *   Outputs   Messages to the simulator are held until all threads are blocked. If the firmware has not answered, the
 *             bytes `idle` are sent instead, so that the simulator need not wait for a time-out.
 *   Start     The clock stands while a start script runs and none of its commands is active in the firmware, and while
 *             the firmware waits for Lapwing's first connection.
 *
 * Lapwing gets these lines through a socket: "attached", "linked", "ready" (all threads wait for the first message),
 * "foreign ..." (a call or traffic that is not repeatable), "stuck ..." (a thread that does not pass the turn on). The
 * clock follows the real time once Lapwing closes the socket, so that the firmware can end.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/futex.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/syscall.h>
#include <sys/times.h>
#include <sys/wait.h>
#include <unistd.h>

enum { SECOND = 1000000000, MOST = 1024, POLLED = 256, HELD = 1 << 16 };
enum { BUSY = 1000, TICK = 100000000, PATIENCE = 50, PAUSE = 50000 };
enum State { READY, LOCK, EVENT, MESSAGE, SCRIPT, STATES }; /* EVENT: condition, semaphore, end of a thread, time */
enum Role { OTHER, SERVER, HANDLER }; /* thread that accepts commands of the start script; thread of one command */

typedef struct Thread {
    int number, tid, go, timed_out, count, busy;
    enum State state;
    enum Role role;
    const void *object;      /* for which it waits */
    uint64_t deadline, turn; /* [ns] 0: none; order in which the threads began to wait */
    uint64_t busy_at;        /* [ns] clock at its last call that may be part of a busy wait */
    struct pollfd *polled;   /* `count` descriptors for which it waits */
    pthread_t handle;
    void *(*function)(void *), *argument;
} Thread;

typedef struct sockaddr_storage Address;
static const uint64_t EPOCH = 1700000000ull * SECOND; /* calendar time at clock 0 */
static Thread *threads[MOST], *current, main_thread;
static __thread Thread *self; /* NULL in threads that this library does not order, and in other processes */
static int alive, created, waiting[STATES], active, edges, answered, script_ended;
static volatile int outside; /* 1 while the thread in turn waits for a message */
static int control = -1, link_fd = -1, link_port, answer_port, held_size, idle_size, to_fd;
static char kind, peers[256]; /* the link begins with 'c'onnect, 's'end or 'b'ind; Lapwing's ports between commas */
static uint64_t clock_ns = SECOND, horizon = UINT64_MAX, step_ns, start_ns, read_ns, seed, turns, calls;
static unsigned char held[HELD], idle[64];
static Address to_address;
static socklen_t to_size;

static void *find(const char *name) { /* conditions have an older version of another size */
    void *result = strncmp(name, "pthread_cond_", 13) ? NULL : dlvsym(RTLD_NEXT, name, "GLIBC_2.3.2");
    return result ? result : dlsym(RTLD_NEXT, name);
}
#define REAL(name) ({ static __typeof__(&name) f_; if (!f_) f_ = (__typeof__(&name))find(#name); f_; })

static void say(const char *format, ...) {
    char text[240];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text - 1, format, values);
    va_end(values);
    strcat(text, "\n");
    syscall(SYS_sendto, control, text, strlen(text), MSG_DONTWAIT | MSG_NOSIGNAL, 0, 0);
}

/* ---- system calls that do not pass the turn on */
static int poll_now(struct pollfd *fds, int count, int wait) {
    struct timespec none = {0, 0};
    return syscall(SYS_ppoll, fds, count, wait ? NULL : &none, NULL, 8);
}
static int option(int fd, int name) {
    int value = 0;
    socklen_t size = sizeof value;
    return getsockopt(fd, SOL_SOCKET, name, &value, &size) ? -1 : value;
}
static int port_of(const void *a) {
    return a && *(sa_family_t *)a == AF_INET ? ntohs(((struct sockaddr_in *)a)->sin_port) : 0;
}
static int is_nonblocking(int fd) { return syscall(SYS_fcntl, fd, F_GETFL, 0) & O_NONBLOCK; }
static void sleep_until_go(Thread *t) {
    while (!__atomic_exchange_n(&t->go, 0, __ATOMIC_ACQ_REL))
        syscall(SYS_futex, &t->go, FUTEX_WAIT_PRIVATE, 0, NULL, NULL, 0);
}
static void let_go(Thread *t) {
    __atomic_store_n(&current, t, __ATOMIC_RELAXED);
    __atomic_store_n(&t->go, 1, __ATOMIC_RELEASE);
    syscall(SYS_futex, &t->go, FUTEX_WAKE_PRIVATE, 1, NULL, NULL, 0);
}

/* ---- the link to the simulator */
static void begin_link(int fd) {
    link_fd = fd;
    horizon = start_ns ? SECOND + start_ns : clock_ns;
    say("linked");
}
static void end_link(void) { link_fd = -1; horizon = UINT64_MAX; }
static int waits_for_link(const Thread *t) {
    for (int k = 0; t->state == MESSAGE && link_fd >= 0 && k < t->count; k++) if (t->polled[k].fd == link_fd) return 1;
    return 0;
}
static int is_answer(const unsigned char *b, size_t n) { /* any, but of the MAVLink messages HIL_ACTUATOR_CONTROLS */
    return kind != 'c' || (n > 10 && ((b[0] == 0xFD && b[7] == 93) || (b[0] == 0xFE && b[5] == 93)));
}
static int hold(int fd, const void *data, int size, const void *to, socklen_t n) {
    if (!self || link_fd < 0 || (fd != link_fd && (!answer_port || port_of(to) != answer_port))) return 0;
    if (kind != 'c') held_size = 0; /* the newest datagram of a step counts */
    if (held_size + size > HELD) return 0;
    memcpy(held + held_size, data, size);
    held_size += size;
    answered |= is_answer(data, size);
    to_fd = fd;
    memcpy(&to_address, to, to_size = to ? n : 0);
    return 1;
}
static void send_held(void) {
    if (edges && !answered && idle_size && (kind == 'c' || to_size))
        hold(kind == 'c' ? link_fd : to_fd, idle, idle_size, to_size ? &to_address : NULL, to_size);
    if (held_size) syscall(SYS_sendto, to_fd, held, held_size, MSG_NOSIGNAL, to_size ? &to_address : NULL, to_size);
    held_size = answered = 0;
}

/* ---- the turn */
static void wake(Thread *t, int timed_out) {
    waiting[t->state]--;
    t->state = READY;
    t->timed_out = timed_out;
}
static void fire_deadlines(void) {
    for (int k = 0; k < alive; k++) {
        Thread *t = threads[k];
        if (t->state && t->deadline && t->deadline <= clock_ns && !waits_for_link(t)) wake(t, 1);
    }
}
static int wake_receivers(int commands) { /* threads whose descriptors are ready; 1: also those of the start script */
    int result = 0;
    for (int k = 0; k < alive; k++) {
        Thread *t = threads[k];
        if (t->state != SCRIPT && (t->state != MESSAGE || (!commands && t->role))) continue;
        if (poll_now(t->polled, t->count, 0) > 0) wake(t, 0), result = 1;
    }
    return result;
}
static void poll_outside(struct pollfd *fds, int count) { /* the first one is Lapwing's, which ends the turns */
    char byte;
    outside = 1;
    while (poll_now(fds, count, 1) < 0 && errno == EINTR);
    outside = 0;
    if (control >= 0 && !syscall(SYS_recvfrom, control, &byte, 1, MSG_DONTWAIT, 0, 0)) end_link(), control = -1;
}
static void wait_outside(int scripts) { /* for the start script and its commands, or for any message */
    struct pollfd fds[POLLED] = {{control, POLLIN, 0}};
    int count = 1;
    for (int k = 0; k < alive; k++) {
        Thread *t = threads[k];
        if (t->state != SCRIPT && (t->state != MESSAGE || waits_for_link(t) || (scripts && !t->role))) continue;
        for (int i = 0; i < t->count && count < POLLED; i++) fds[count++] = t->polled[i];
    }
    poll_outside(fds, count);
    wake_receivers(1);
}
static void next_message(void) {
    struct pollfd fds[2] = {{control, POLLIN, 0}, {link_fd, POLLIN, 0}};
    send_held();
    if (!edges) say("ready");
    poll_outside(fds, 2);
    if (link_fd < 0) return;
    edges = 1;
    horizon = (read_ns ? horizon : clock_ns) + step_ns;
    if (!read_ns) clock_ns = horizon;
    wake_receivers(!waiting[SCRIPT]);
    fire_deadlines();
}
static void pass_time_until(uint64_t due) { /* at the end about as fast as real time: time-outs are reported, not floods */
    if (due <= clock_ns) return;
    struct timespec rest = {0, due - clock_ns < TICK ? due - clock_ns : TICK};
    if (control < 0) syscall(SYS_nanosleep, &rest, NULL);
    clock_ns = due;
}
static Thread *ready_thread(void) { /* the next in the order of creation, or a random one */
    static Thread *ready[MOST];
    int count = 0, next = 0;
    for (int k = 0; k < alive; k++) if (threads[k]->state == READY) ready[count++] = threads[k];
    if (!count) return NULL;
    if (seed) { /* xorshift64 */
        seed ^= seed << 13, seed ^= seed >> 7, seed ^= seed << 17;
        return ready[seed % count];
    }
    while (next < count && ready[next]->number <= current->number) next++;
    return ready[next % count];
}
static Thread *next_thread(void) {
    Thread *t;
    while (!(t = ready_thread())) {
        int reader = 0, commands = 0, opening = 0;
        uint64_t due = 0;
        for (int k = 0; k < alive; k++) {
            t = threads[k];
            reader |= waits_for_link(t);
            commands |= t->role == HANDLER && t->state != MESSAGE;
            opening |= t->state == MESSAGE && t->object == &accept && link_fd < 0;
            if (t->deadline && !waits_for_link(t) && (!due || t->deadline < due)) due = t->deadline;
        }
        if (waiting[SCRIPT] && !commands) wait_outside(1);
        else if (link_fd >= 0 && (reader || read_ns) && !(due && due <= horizon)) next_message();
        else if (link_fd < 0 && wake_receivers(!waiting[SCRIPT])) continue;
        else if (due && !opening) pass_time_until(due), fire_deadlines();
        else wait_outside(0);
    }
    return t;
}
static void pass_turn(void) {
    Thread *own = self, *next = next_thread();
    calls++;
    if (next == own) return;
    let_go(next);
    sleep_until_go(own);
}
static int wait_for(enum State state, const void *object, uint64_t deadline) { /* 1: the deadline has passed */
    self->object = object;
    self->deadline = deadline;
    self->turn = turns++;
    waiting[self->state = state]++;
    pass_turn();
    self->deadline = 0;
    self->object = NULL;
    return self->timed_out;
}
static int wake_waiting(enum State state, const void *object, int all) { /* the one that has waited longest, or all */
    while (waiting[state]) {
        Thread *first = NULL;
        for (int k = 0; k < alive; k++) {
            Thread *t = threads[k];
            if (t->state == state && t->object == object && (!first || t->turn < first->turn)) first = t;
        }
        if (!first) break;
        wake(first, 0);
        if (!all) break;
    }
    return 0;
}
static void may_be_busy(void) { /* a thread that only asks, again and again, sleeps for 50 us */
    calls++;
    if (!self) return;
    if (self->busy_at != clock_ns) self->busy_at = clock_ns, self->busy = 0;
    if (++self->busy >= BUSY) self->busy = 0, wait_for(EVENT, NULL, clock_ns + PAUSE);
}

/* ---- threads */
static pthread_key_t end_key;
static Thread *add_thread(Thread *t) {
    if (alive == MOST) say("stuck more than %d threads", MOST), abort();
    t->number = created++;
    return threads[alive++] = t;
}
static void remove_thread(Thread *t) {
    int k = 0;
    while (threads[k] != t) k++;
    memmove(threads + k, threads + k + 1, (--alive - k) * sizeof *threads);
    wake_waiting(EVENT, t, 1);
}
static void end_thread(void *round) { /* as the last of the thread's destructors */
    if ((intptr_t)round < PTHREAD_DESTRUCTOR_ITERATIONS - 1) { pthread_setspecific(end_key, (char *)round + 1); return; }
    remove_thread(self);
    self = NULL;
    let_go(next_thread());
}
static void *run_thread(void *own) {
    self = own;
    self->tid = syscall(SYS_gettid);
    sleep_until_go(self);
    pthread_setspecific(end_key, (void *)1);
    return self->function(self->argument);
}
int pthread_create(pthread_t *handle, const pthread_attr_t *attributes, void *(*function)(void *), void *argument) {
    if (!self) return REAL(pthread_create)(handle, attributes, function, argument);
    Thread *t = add_thread(calloc(1, sizeof *t));
    t->function = function;
    t->argument = argument;
    t->role = self->role == SERVER ? HANDLER : OTHER;
    int result = REAL(pthread_create)(&t->handle, attributes, run_thread, t);
    *handle = t->handle;
    if (result) remove_thread(t);
    return result;
}
int pthread_join(pthread_t handle, void **result) {
    for (int k = 0; self && k < alive; k++)
        if (threads[k] != self && pthread_equal(threads[k]->handle, handle)) { wait_for(EVENT, threads[k], 0); break; }
    return REAL(pthread_join)(handle, result);
}
int sched_yield(void) {
    if (!self) return syscall(SYS_sched_yield);
    return may_be_busy(), pass_turn(), 0;
}

/* ---- locks, conditions, semaphores */
#define LOCKED(name, try, object) ({ int r_; calls++; \
    if (!self) r_ = REAL(name)(object); else while ((r_ = REAL(try)(object)) == EBUSY) wait_for(LOCK, object, 0); r_; })
#define UNLOCKED(name, object) ({ int r_ = REAL(name)(object); if (self) wake_waiting(LOCK, object, 1); r_; })
int pthread_mutex_lock(pthread_mutex_t *m) { return LOCKED(pthread_mutex_lock, pthread_mutex_trylock, m); }
int pthread_mutex_unlock(pthread_mutex_t *m) { return UNLOCKED(pthread_mutex_unlock, m); }
int pthread_rwlock_rdlock(pthread_rwlock_t *l) { return LOCKED(pthread_rwlock_rdlock, pthread_rwlock_tryrdlock, l); }
int pthread_rwlock_wrlock(pthread_rwlock_t *l) { return LOCKED(pthread_rwlock_wrlock, pthread_rwlock_trywrlock, l); }
int pthread_rwlock_unlock(pthread_rwlock_t *l) { return UNLOCKED(pthread_rwlock_unlock, l); }
int pthread_mutex_trylock(pthread_mutex_t *m) {
    int result = REAL(pthread_mutex_trylock)(m);
    if (result == EBUSY) may_be_busy();
    return result;
}
static uint64_t nanoseconds(const struct timespec *t) { return (uint64_t)t->tv_sec * SECOND + t->tv_nsec; }
static uint64_t deadline_at(const struct timespec *t) { /* of the monotonic or the calendar clock */
    uint64_t ns = nanoseconds(t);
    return ns >= EPOCH ? ns - EPOCH : ns ? ns : 1;
}
static int wait_condition(pthread_cond_t *c, pthread_mutex_t *m, uint64_t deadline) {
    pthread_mutex_unlock(m);
    int timed_out = wait_for(EVENT, c, deadline);
    pthread_mutex_lock(m);
    return timed_out ? ETIMEDOUT : 0;
}
int pthread_cond_wait(pthread_cond_t *c, pthread_mutex_t *m) {
    return self ? wait_condition(c, m, 0) : REAL(pthread_cond_wait)(c, m);
}
int pthread_cond_timedwait(pthread_cond_t *c, pthread_mutex_t *m, const struct timespec *t) {
    return self ? wait_condition(c, m, deadline_at(t)) : REAL(pthread_cond_timedwait)(c, m, t);
}
int pthread_cond_clockwait(pthread_cond_t *c, pthread_mutex_t *m, clockid_t clock, const struct timespec *t) {
    return self ? wait_condition(c, m, deadline_at(t)) : REAL(pthread_cond_clockwait)(c, m, clock, t);
}
int pthread_cond_signal(pthread_cond_t *c) { return self ? wake_waiting(EVENT, c, 0) : REAL(pthread_cond_signal)(c); }
int pthread_cond_broadcast(pthread_cond_t *c) {
    return self ? wake_waiting(EVENT, c, 1) : REAL(pthread_cond_broadcast)(c);
}
static int wait_semaphore(sem_t *s, uint64_t deadline) {
    while (REAL(sem_trywait)(s)) {
        if (errno != EAGAIN) return -1;
        if (wait_for(EVENT, s, deadline)) return errno = ETIMEDOUT, -1;
    }
    return 0;
}
int sem_wait(sem_t *s) { return self ? wait_semaphore(s, 0) : REAL(sem_wait)(s); }
int sem_timedwait(sem_t *s, const struct timespec *t) {
    return self ? wait_semaphore(s, deadline_at(t)) : REAL(sem_timedwait)(s, t);
}
int sem_post(sem_t *s) {
    int result = REAL(sem_post)(s);
    if (self) wake_waiting(EVENT, s, 0);
    return result;
}

/* ---- time */
static uint64_t read_clock(void) {
    if (!read_ns) may_be_busy();
    else if (self && (clock_ns += read_ns) >= horizon) clock_ns = horizon, wait_for(EVENT, NULL, horizon + 1);
    calls++;
    return clock_ns;
}
static int sleep_for(uint64_t ns) {
    struct timespec t = {ns / SECOND, ns % SECOND};
    if (!self) return syscall(SYS_nanosleep, &t, NULL);
    return wait_for(EVENT, NULL, clock_ns + (ns ? ns : 1)), 0;
}
int usleep(useconds_t us) { return sleep_for(us * 1000ull); }
unsigned sleep(unsigned s) { return sleep_for((uint64_t)s * SECOND); }
int nanosleep(const struct timespec *t, struct timespec *left) { return (void)left, sleep_for(nanoseconds(t)); }
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *t, struct timespec *left) {
    if (!self) return REAL(clock_nanosleep)(clock, flags, t, left);
    uint64_t at = deadline_at(t);
    return sleep_for(!(flags & TIMER_ABSTIME) ? nanoseconds(t) : at > clock_ns ? at - clock_ns : 0);
}
int clock_gettime(clockid_t clock, struct timespec *t) {
    if (!active) return syscall(SYS_clock_gettime, clock, t);
    int calendar = clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE;
    uint64_t ns = read_clock() + (calendar ? EPOCH : 0);
    *t = (struct timespec){ns / SECOND, ns % SECOND};
    return 0;
}
int clock_settime(clockid_t c, const struct timespec *t) { return active ? 0 : syscall(SYS_clock_settime, c, t); }
static struct timespec calendar(void) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return now;
}
int gettimeofday(struct timeval *restrict t, void *restrict zone) {
    struct timespec now = calendar();
    *t = (struct timeval){now.tv_sec, now.tv_nsec / 1000};
    return (void)zone, 0;
}
time_t time(time_t *t) { time_t now = calendar().tv_sec; return t ? *t = now : now; }
clock_t times(struct tms *t) { return active ? *t = (struct tms){0}, read_clock() / (SECOND / 100) : REAL(times)(t); }
ssize_t getrandom(void *data, size_t size, unsigned flags) {
    return active ? memset(data, 0x5A, size), (ssize_t)size : syscall(SYS_getrandom, data, size, flags);
}

/* ---- messages */
static void wait_message(enum State state, struct pollfd *fds, int count, uint64_t deadline, const void *object) {
    self->polled = fds;
    self->count = count;
    wait_for(state, object, deadline);
}
static int available(struct pollfd *fds, int count) { /* without waiting for the next message of the link */
    if (count && option(fds[0].fd, SO_DOMAIN) == AF_UNIX && option(fds[0].fd, SO_ACCEPTCONN) == 1) self->role = SERVER;
    for (int k = 0; k < count; k++) if (!edges && link_fd >= 0 && fds[k].fd == link_fd) return 0;
    return self->role == OTHER && poll_now(fds, count, 0) > 0;
}
static void before_receive(int fd, int flags, const void *object) {
    struct pollfd p = {fd, POLLIN, 0};
    if (self && !(flags & MSG_DONTWAIT) && !is_nonblocking(fd) && !available(&p, 1)) wait_message(MESSAGE, &p, 1, 0, object);
}
static void check_peer(int port) {
    char text[16];
    snprintf(text, sizeof text, ",%d,", port);
    if (!strstr(peers, text)) say("foreign it gets messages by port %d, as from a ground station", port);
}
int poll(struct pollfd *fds, nfds_t count, int ms) {
    struct timespec t = {ms / 1000, ms % 1000 * 1000000l};
    if (!self) return syscall(SYS_ppoll, fds, count, ms < 0 ? NULL : &t, NULL, 8);
    if (!ms) may_be_busy();
    else if (!available(fds, count)) wait_message(MESSAGE, fds, count, ms < 0 ? 0 : clock_ns + ms * 1000000ull, NULL);
    return poll_now(fds, count, 0);
}
int select(int size, fd_set *in, fd_set *out, fd_set *error, struct timeval *t) {
    struct pollfd fds[POLLED];
    struct timespec none = {0, 0}, given = t ? (struct timespec){t->tv_sec, t->tv_usec * 1000} : none;
    if (!self) return syscall(SYS_pselect6, size, in, out, error, t ? &given : NULL, NULL);
    int count = 0;
    for (int k = 0; k < size && count < POLLED; k++) {
        short events = (in && FD_ISSET(k, in) ? POLLIN : 0) | (out && FD_ISSET(k, out) ? POLLOUT : 0);
        if (events) fds[count++] = (struct pollfd){k, events, 0};
    }
    if (t && !nanoseconds(&given)) may_be_busy();
    else if (!available(fds, count)) wait_message(MESSAGE, fds, count, t ? clock_ns + nanoseconds(&given) : 0, NULL);
    return syscall(SYS_pselect6, size, in, out, error, &none, NULL);
}
ssize_t recvfrom(int fd, void *data, size_t size, int flags, struct sockaddr *from, socklen_t *from_size) {
    Address sender = {0};
    socklen_t sender_size = sizeof sender;
    before_receive(fd, flags, NULL);
    if (self && fd == link_fd && !edges) return errno = EAGAIN, -1;
    ssize_t result = syscall(SYS_recvfrom, fd, data, size, flags, &sender, &sender_size);
    int error = errno;
    if (self && result < 0) may_be_busy();
    if (self && result == 0 && fd == link_fd && kind == 'c') end_link();
    if (self && result > 0 && fd != link_fd && port_of(&sender)) check_peer(port_of(&sender));
    if (from && from_size) memcpy(from, &sender, *from_size < sender_size ? *from_size : sender_size), *from_size = sender_size;
    return errno = error, result;
}
ssize_t recv(int fd, void *data, size_t size, int flags) { return recvfrom(fd, data, size, flags, NULL, NULL); }
ssize_t read(int fd, void *data, size_t size) {
    return self && option(fd, SO_TYPE) > 0 ? recv(fd, data, size, 0) : syscall(SYS_read, fd, data, size);
}
int accept4(int fd, struct sockaddr *from, socklen_t *size, int flags) {
    Address own;
    socklen_t n = sizeof own;
    struct pollfd p = {fd, POLLIN, 0}; /* a server that has polled holds a lock for which its commands may wait */
    if (!self || self->role != SERVER || poll_now(&p, 1, 0) <= 0)
        before_receive(fd, 0, option(fd, SO_DOMAIN) == AF_UNIX ? NULL : &accept);
    int result = syscall(SYS_accept4, fd, from, size, flags);
    if (self && self->role == SERVER && script_ended) say("foreign it gets commands from another shell");
    if (self && result >= 0 && !getsockname(result, (void *)&own, &n) && port_of(&own)) check_peer(port_of(&own));
    return result;
}
int accept(int fd, struct sockaddr *from, socklen_t *size) { return accept4(fd, from, size, 0); }
int connect(int fd, const struct sockaddr *to, socklen_t size) {
    int result = syscall(SYS_connect, fd, to, size);
    if (self && (result == 0 || errno == EINPROGRESS) && kind == 'c' && port_of(to) == link_port) begin_link(fd);
    return result;
}
int bind(int fd, const struct sockaddr *own, socklen_t size) {
    int result = syscall(SYS_bind, fd, own, size);
    if (self && result == 0 && kind == 'b' && port_of(own) == link_port) begin_link(fd);
    return result;
}
ssize_t sendto(int fd, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t n) {
    calls++;
    if (self && kind == 's' && link_fd < 0 && control >= 0 && port_of(to) == link_port) begin_link(fd);
    return hold(fd, data, size, to, n) ? (ssize_t)size : syscall(SYS_sendto, fd, data, size, flags, to, n);
}
ssize_t send(int fd, const void *data, size_t size, int flags) { return sendto(fd, data, size, flags, NULL, 0); }
ssize_t write(int fd, const void *data, size_t size) {
    return self && fd == link_fd ? send(fd, data, size, 0) : syscall(SYS_write, fd, data, size);
}
int ioctl(int fd, unsigned long request, ...) { /* the system empties the queue of a socket by wall time */
    va_list values;
    va_start(values, request);
    void *argument = va_arg(values, void *);
    va_end(values);
    return active && request == TIOCOUTQ ? *(int *)argument = 0 : syscall(SYS_ioctl, fd, request, argument);
}

/* ---- start script, and calls that are not ordered */
extern char **environ;
int system(const char *command) {
    if (!self) return REAL(system)(command);
    char *arguments[] = {"sh", "-c", (char *)command, NULL};
    pid_t pid;
    int status = -1;
    if (!command || posix_spawn(&pid, "/bin/sh", NULL, NULL, arguments, environ)) return -1;
    struct pollfd p = {syscall(SYS_pidfd_open, pid, 0), POLLIN, 0};
    wait_message(SCRIPT, &p, 1, 0, NULL);
    script_ended = 1;
    while (waitpid(pid, &status, 0) < 0 && errno == EINTR);
    return close(p.fd), status;
}
#define FOREIGN(name) \
    long foreign_##name(long a, long b, long c, long d, long e, long f) __asm__(#name); \
    long foreign_##name(long a, long b, long c, long d, long e, long f) { \
        static long (*real)(long, long, long, long, long, long); \
        if (!real) { real = find(#name); if (active) say("foreign it calls %s, which cannot be ordered", #name); } \
        return real(a, b, c, d, e, f); \
    }
FOREIGN(sigwait) FOREIGN(sigwaitinfo) FOREIGN(sigtimedwait) FOREIGN(sigsuspend) FOREIGN(pause) FOREIGN(msgrcv)
FOREIGN(pthread_cancel) FOREIGN(pthread_barrier_wait) FOREIGN(pthread_mutex_timedlock) FOREIGN(pselect) FOREIGN(ppoll)
FOREIGN(timer_settime) FOREIGN(timerfd_settime) FOREIGN(setitimer) FOREIGN(alarm) FOREIGN(mq_receive)
FOREIGN(recvmsg) FOREIGN(recvmmsg) FOREIGN(epoll_wait) FOREIGN(epoll_pwait)

/* ---- a thread that does not pass the turn on */
static void *watch(void *unused) { /* its time does not pass while the program is stopped */
    struct timespec tick = {0, TICK}, cpu = {0, 0};
    uint64_t seen = 0, begin = 0;
    for (int blocked = 0;; syscall(SYS_nanosleep, &tick, NULL)) {
        Thread *t = __atomic_load_n(&current, __ATOMIC_RELAXED);
        uint64_t now = __atomic_load_n(&calls, __ATOMIC_RELAXED);
        char path[64], name[32] = "", state = 0;
        snprintf(path, sizeof path, "/proc/self/task/%d/stat", t->tid);
        FILE *file = fopen(path, "r");
        if (file) fscanf(file, "%*d (%31[^)]) %c", name, &state), fclose(file);
        syscall(SYS_clock_gettime, (~(clockid_t)t->tid << 3) | 6, &cpu); /* CPU time of the thread */
        if (now != seen || outside) { seen = now, begin = nanoseconds(&cpu), blocked = 0; continue; }
        blocked = state == 'S' ? blocked + 1 : 0;
        int spins = nanoseconds(&cpu) - begin > (uint64_t)PATIENCE * TICK;
        if (!spins && blocked < PATIENCE) continue;
        const char *text = spins ? "spins: 5 s of CPU time without a call at which others can run"
                                 : "waits in a call that cannot be ordered";
        say("stuck thread %s (number %d) %s", name, t->number, text);
        return unused;
    }
}
static void in_child(void) { self = NULL; active = 0; }
__attribute__((constructor)) static void begin(void) {
    const char *text = getenv("LAPWING_REPEATABLE");
    char hex[129] = "";
    if (!text || getppid() != atoi(text)) return; /* a process that the firmware has started, not Lapwing */
    if (sscanf(text, "%*d %d %c %d %d %lu %lu %lu %lu %128s %255s", &control, &kind, &link_port, &answer_port, &step_ns,
               &start_ns, &read_ns, &seed, hex, peers) != 10) return;
    while (idle_size < 64 && sscanf(hex + 2 * idle_size, "%2hhx", &idle[idle_size]) == 1) idle_size++;
    self = current = add_thread(&main_thread);
    self->tid = getpid();
    self->handle = pthread_self();
    pthread_key_create(&end_key, end_thread);
    pthread_setspecific(end_key, (void *)1);
    pthread_atfork(NULL, NULL, in_child);
    active = 1;
    say("attached");
    pthread_t watcher;
    REAL(pthread_create)(&watcher, NULL, watch, NULL);
}
