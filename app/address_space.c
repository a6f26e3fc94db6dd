/* Refuses to start where the limit of address space (ulimit -v) is too small for OpenBLAS: while it is loaded, before main,
   and in its first products OpenBLAS asks for its buffers again and again, for ever, if it does not get them. Functions in .preinit_array run
   before the constructors of all libraries; only C can place one there. */
#ifdef __linux__
#include <string.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

/* Measured with OpenBLAS 0.3.21, whose buffers have 128 MB: 352 MB do with one thread, 508 MB with two; with some reserve. */
static const rlim_t base = 384ull << 20, per_thread = 160ull << 20;

static long threads(char **environment)
{
    const char *names[] = {"OPENBLAS_NUM_THREADS=", "OMP_NUM_THREADS="};
    long n = sysconf(_SC_NPROCESSORS_ONLN);
    for (int k = 0; k < 2; k++)
        for (char **entry = environment; *entry; entry++)
            if (strncmp(*entry, names[k], strlen(names[k])) == 0) {
                long asked = atol(*entry + strlen(names[k]));
                if (asked > 0)
                    return asked < n ? asked : n;
            }
    return n;
}

static void check_address_space(int count, char **arguments, char **environment)
{
    static const char message[] = "microslip: the address space is limited (ulimit -v) to less than the BLAS needs for its "
                                  "threads: raise the limit, or lower OMP_NUM_THREADS\n";
    struct rlimit limit;
    (void)count;
    (void)arguments;
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return;
    if (limit.rlim_cur < base + per_thread * (rlim_t)(threads(environment) - 1)) {
        if (write(2, message, sizeof message - 1) < 0)
            _exit(1);
        _exit(1);
    }
}

__attribute__((section(".preinit_array"), used)) static void (*const first)(int, char **, char **) = check_address_space;
#endif
