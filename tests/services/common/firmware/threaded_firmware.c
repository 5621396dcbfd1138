/* Program that behaves as a firmware: its answers depend on the order of its threads, on its clock, and on a start script.
 *
 * usage: threaded_firmware bind STATE_PORT MOTOR_PORT | send PORT | connect PORT SOCKET_PATH | client SOCKET_PATH PID TEXT...
 *        with a further argument "spin", "barrier" or "foreign PORT": it breaks the rule of this name.
 *        "alone": without its other threads. A point on the standard output: no message for 0.1 s.
 *        A client sends commands; if PID is not 0, they come together, because this process is stopped meanwhile.
 */
#include <arpa/inet.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

static uint64_t state = 1, message, taken;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t arrived = PTHREAD_COND_INITIALIZER;
static int breaks, alone;

static void mix(uint64_t number) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    state = (state ^ number ^ (uint64_t)now.tv_nsec) * 6364136223846793005ull + 1442695040888963407ull;
}
static void *sleeper(void *number) {
    for (;;) {
        usleep(300 * (unsigned)(uintptr_t)number);
        pthread_mutex_lock(&lock);
        mix((uintptr_t)number);
        pthread_mutex_unlock(&lock);
    }
}
static void *worker(void *number) {
    for (uint64_t seen = 0;;) {
        pthread_mutex_lock(&lock);
        while (seen == taken) pthread_cond_wait(&arrived, &lock);
        seen = taken;
        mix((uintptr_t)number + message);
        pthread_mutex_unlock(&lock);
    }
}
static void *timed(void *number) {
    for (;;) {
        struct timespec until;
        clock_gettime(CLOCK_REALTIME, &until);
        until.tv_nsec += 700000;
        if (until.tv_nsec >= 1000000000) until.tv_nsec -= 1000000000, until.tv_sec++;
        pthread_mutex_lock(&lock);
        if (pthread_cond_timedwait(&arrived, &lock, &until)) mix((uintptr_t)number);
        pthread_mutex_unlock(&lock);
    }
}
static void *yielder(void *number) {
    for (uint64_t seen = 0;; seen = taken) {
        while (seen == taken) sched_yield();
        if (pthread_mutex_trylock(&lock) == 0) { mix((uintptr_t)number); pthread_mutex_unlock(&lock); }
    }
}
static void *short_lived(void *number) { mix((uintptr_t)number); return NULL; }
static void *misbehave(void *unused) {
    while (taken < 50) usleep(500);
    if (breaks == 1) for (volatile uint64_t k = 0;; k++);
    static pthread_barrier_t barrier;
    pthread_barrier_init(&barrier, NULL, 1);
    pthread_barrier_wait(&barrier);
    return unused;
}
static void *foreign(void *port) {
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_port = htons((uintptr_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    char data[64];
    if (bind(fd, (void *)&own, sizeof own)) exit(3);
    while (recv(fd, data, sizeof data, 0) > 0) mix(7);
    return NULL;
}
static void start(void *(*function)(void *), uintptr_t number) {
    pthread_t t;
    pthread_create(&t, NULL, function, (void *)number);
    pthread_detach(t);
}
static void start_all(void) {
    for (uintptr_t k = 1; k <= 3; k++) start(sleeper, k), start(worker, 10 + k);
    start(timed, 20);
    start(yielder, 30);
}
static uint64_t answer(uint64_t value) { /* to a message */
    pthread_t t;
    pthread_mutex_lock(&lock);
    message = value;
    taken++;
    pthread_cond_broadcast(&arrived);
    pthread_mutex_unlock(&lock);
    pthread_create(&t, NULL, short_lived, (void *)(uintptr_t)40);
    pthread_join(t, NULL);
    return state;
}
static pthread_mutex_t commands = PTHREAD_MUTEX_INITIALIZER; /* as in PX4, also held while a connection is accepted */
static void *handler(void *fd) { /* of a command of the start script */
    char data[64];
    ssize_t n = recv((int)(intptr_t)fd, data, sizeof data, 0);
    usleep(2000);
    mix(n);
    if (data[0] == 's') start_all();
    send((int)(intptr_t)fd, "ok", 2, MSG_NOSIGNAL);
    pthread_mutex_lock(&commands);
    close((int)(intptr_t)fd);
    pthread_mutex_unlock(&commands);
    return NULL;
}
static void *server(void *fd) {
    for (;;) {
        struct pollfd p = {(int)(intptr_t)fd, POLLIN, 0};
        poll(&p, 1, -1);
        pthread_mutex_lock(&commands);
        int client = accept(p.fd, NULL, NULL);
        if (client >= 0) start(handler, client);
        pthread_mutex_unlock(&commands);
    }
}
static int commands_of(const char *path, int pid, char **texts, int count) {
    struct sockaddr_un at = {.sun_family = AF_UNIX};
    int fds[8], result = 0;
    char data[8];
    strncpy(at.sun_path, path, sizeof at.sun_path - 1);
    if (pid) kill(pid, SIGSTOP);
    for (int k = 0; k < count; k++) {
        fds[k] = socket(AF_UNIX, SOCK_STREAM, 0);
        if (connect(fds[k], (void *)&at, sizeof at)) result = 4;
        send(fds[k], texts[k], strlen(texts[k]), MSG_NOSIGNAL);
    }
    if (pid) kill(pid, SIGCONT);
    for (int k = 0; k < count; k++) if (recv(fds[k], data, sizeof data, 0) != 2) result = 5;
    return result;
}
static void run_script(const char *program, const char *path, int together) {
    struct sockaddr_un own = {.sun_family = AF_UNIX};
    const char *format = "for k in first start last; do '%s' client '%s' 0 $k || exit 7; done";
    char text[1024];
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    strncpy(own.sun_path, path, sizeof own.sun_path - 1);
    if (bind(fd, (void *)&own, sizeof own) || listen(fd, 5)) exit(6);
    start(server, fd);
    snprintf(text, sizeof text, together ? "'%s' client '%s' %d first start last" : format, program, path, getpid());
    if (system(text)) exit(7);
}
int main(int count, char **arguments) {
    const char *kind = arguments[1];
    if (!strcmp(kind, "client")) return commands_of(arguments[2], atoi(arguments[3]), arguments + 4, count - 4);
    for (int k = 2; k < count; k++) {
        if (!strcmp(arguments[k], "spin")) breaks = 1;
        if (!strcmp(arguments[k], "barrier")) breaks = 2;
        if (!strcmp(arguments[k], "alone")) alone = 1;
        if (!strcmp(arguments[k], "foreign")) start(foreign, atoi(arguments[k + 1]));
    }
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons(atoi(arguments[2])), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    int stream = !strcmp(kind, "connect"), fd = socket(AF_INET, stream ? SOCK_STREAM : SOCK_DGRAM, 0), out = fd;
    if (breaks) start(misbehave, 0);
    if (stream) {
        while (connect(fd, (void *)&at, sizeof at)) usleep(1000);
        run_script(arguments[0], arguments[3], count > 4);
    } else if (!alone) start_all();
    if (!strcmp(kind, "bind")) {
        if (bind(fd, (void *)&at, sizeof at)) return 8;
        at.sin_port = htons(atoi(arguments[3]));
        out = socket(AF_INET, SOCK_DGRAM, 0);
    }
    struct sockaddr *to = stream ? NULL : (void *)&at;
    uint64_t value = 0;
    if (!strcmp(kind, "send")) sendto(out, &state, 8, 0, to, sizeof at);
    for (;;) {
        fd_set set;
        struct timeval wait = {0, 100000};
        FD_ZERO(&set);
        FD_SET(fd, &set);
        if (select(fd + 1, &set, NULL, NULL, &wait) <= 0) { write(1, ".", 1); continue; }
        if (recv(fd, &value, 8, 0) != 8) return 0;
        uint64_t result = answer(value);
        if (value % 10 != 9) sendto(out, &result, 8, MSG_NOSIGNAL, to, to ? sizeof at : 0); /* not in each step */
    }
}
