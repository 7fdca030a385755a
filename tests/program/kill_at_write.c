/* Preloaded into a run: kills the process just before one of its operations on files of checkpoints. With KILL_FULL,
 * that operation fails instead, as on a full disk.
 *
 * Operations (open, write, sync, remove) on paths that contain "checkpoint" count from the first path that contains
 * KILL_FROM until the first that contains KILL_UNTIL; that number KILL_AT does not take place. With KILL_RANK, only that
 * process of an MPI run is killed. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static atomic_int counts, count;

/* Returns 1 if the operation fails. */
static int before(const char *path) {
    const char *from = getenv("KILL_FROM"), *until = getenv("KILL_UNTIL"), *at = getenv("KILL_AT");
    const char *rank = getenv("KILL_RANK"), *own = getenv("OMPI_COMM_WORLD_RANK");
    if (!from || !until || !at || !strstr(path, "checkpoint") || (rank && (!own || strcmp(rank, own) != 0))) return 0;
    if (strstr(path, from)) atomic_store(&counts, 1);
    if (strstr(path, until)) atomic_store(&counts, 0);
    if (!atomic_load(&counts) || atomic_fetch_add(&count, 1) + 1 != atoi(at)) return 0;
    if (!getenv("KILL_FULL")) {
        kill(getpid(), SIGKILL);
        pause();
    }
    errno = ENOSPC;
    return 1;
}

static int before_fd(int fd) {
    char link[32], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length <= 0) return 0;
    path[length] = 0;
    return before(path);
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

#define OPEN(name)                                           \
    int name(const char *path, int flags, ...) {             \
        va_list rest;                                        \
        va_start(rest, flags);                               \
        mode_t mode = va_arg(rest, mode_t);                  \
        va_end(rest);                                        \
        if (before(path)) return -1;                         \
        return NEXT(name)(path, flags, mode);                \
    }

OPEN(open)
OPEN(open64)

ssize_t write(int fd, const void *bytes, size_t length) {
    if (before_fd(fd)) return -1;
    return NEXT(write)(fd, bytes, length);
}

int fsync(int fd) {
    if (before_fd(fd)) return -1;
    return NEXT(fsync)(fd);
}

int fdatasync(int fd) {
    if (before_fd(fd)) return -1;
    return NEXT(fdatasync)(fd);
}

int unlink(const char *path) {
    if (before(path)) return -1;
    return NEXT(unlink)(path);
}
