/* Makes a program believe that its machine has many processors.

   Libraries start a thread for each processor, and the allocator reserves address space for each thread: what fits on
   two processors may not fit on 128. The program still runs on the processors that there are.

   Build: gcc -shared -fPIC -o many_processors.so tests/helpers/conditions/many_processors.c
   Use:   PROCESSORS=128 LD_PRELOAD=$PWD/many_processors.so dextron-bench recordings list recordings

   PROCESSORS is 64 if it is not set. Python, NumPy, PyTorch and Rust's libraries ask the functions below. glibc's
   allocator asks the kernel, so its number of arenas, eight for each processor, is set directly, unless the environment
   sets it. Not shown: a quota of a control group, by which Rust's libraries start fewer threads. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <malloc.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static int processors(void) {
    const char *text = getenv("PROCESSORS");
    int count = text ? atoi(text) : 64;
    return count > 0 ? count : 64;
}

__attribute__((constructor)) static void allow_arenas(void) {
    const char *tunables = getenv("GLIBC_TUNABLES");
    if (!getenv("MALLOC_ARENA_MAX") && !(tunables && strstr(tunables, "arena_max")))
        mallopt(M_ARENA_MAX, 8 * processors());
}

long sysconf(int name) {
    if (name == _SC_NPROCESSORS_ONLN || name == _SC_NPROCESSORS_CONF) return processors();
    long (*real)(int) = (long (*)(int))dlsym(RTLD_NEXT, "sysconf");
    return real(name);
}

int get_nprocs(void) { return processors(); }

int get_nprocs_conf(void) { return processors(); }

int sched_getaffinity(pid_t process, size_t size, cpu_set_t *set) {
    (void)process;
    if (8 * size < (size_t)processors()) {
        errno = EINVAL; /* The kernel refuses a set that is too small, and Python then asks with a larger one. */
        return -1;
    }
    memset(set, 0, size);
    for (int processor = 0; processor < processors(); processor++) CPU_SET_S(processor, size, set);
    return 0;
}
