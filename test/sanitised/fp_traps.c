/* Floating-point traps for a program's own code, to be preloaded: an operation of the program that is invalid, divides by
 * zero or overflows ends it with SIGFPE and the place on stderr. Libraries are excused (LAPACK asks whether infinities
 * work by making one, HDF5 tries conversions): their instruction is done again without traps, in single step, and the
 * traps are set again behind it. Linux on x86-64.
 *
 *     gcc -shared -fPIC -O1 -o fp_traps.so fp_traps.c -ldl -lm;  LD_PRELOAD=./fp_traps.so PROGRAM ...
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fenv.h>
#include <link.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <ucontext.h>

enum { TRAPS = FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW, SINGLE_STEP = 0x100 };

typedef void (*handler_t)(int);

static char *first, *last; /* code of the program itself */
static handler_t fortran_handler;

static int find_program(struct dl_phdr_info *object, size_t size, void *unused)
{
    (void)size, (void)unused;
    for (int k = 0; k < object->dlpi_phnum; ++k) {
        const ElfW(Phdr) *part = &object->dlpi_phdr[k];
        if (part->p_type == PT_LOAD && (part->p_flags & PF_X)) {
            first = (char *)object->dlpi_addr + part->p_vaddr;
            last = first + part->p_memsz;
        }
    }
    return 1; /* the first object is the program */
}

static void set_traps(ucontext_t *context, int on)
{
    unsigned mask = TRAPS << 7;
    struct _libc_fpstate *state = context->uc_mcontext.fpregs;
    state->mxcsr = on ? state->mxcsr & ~mask : state->mxcsr | mask;
    state->cwd = on ? state->cwd & ~TRAPS : state->cwd | TRAPS;
    state->mxcsr &= ~(unsigned)FE_ALL_EXCEPT;
    state->swd &= ~(0x80 | FE_ALL_EXCEPT);
    long long *flags = &context->uc_mcontext.gregs[REG_EFL];
    *flags = on ? *flags & ~SINGLE_STEP : *flags | SINGLE_STEP;
}

static void on_exception(int number, siginfo_t *info, void *where)
{
    ucontext_t *context = where;
    char *at = (char *)context->uc_mcontext.gregs[REG_RIP];

    if (at >= first && at < last) {
        dprintf(2, "floating-point trap: %s\n", info->si_code == FPE_FLTDIV ? "division by zero"
                : info->si_code == FPE_FLTOVF ? "overflow" : "invalid operation");
        if (fortran_handler) fortran_handler(number); /* tells where */
        signal(number, SIG_DFL);
        raise(number);
    }
    set_traps(context, 0);
}

static void behind_step(int number, siginfo_t *info, void *where)
{
    (void)number, (void)info;
    set_traps(where, 1);
}

/* The Fortran library asks for these signals when the program starts. It shall not have them, but is called in the end. */
handler_t signal(int number, handler_t handler)
{
    static handler_t (*real)(int, handler_t);
    if (number == SIGTRAP) return SIG_DFL;
    if (number == SIGFPE && handler != SIG_DFL) {
        fortran_handler = handler;
        return SIG_DFL;
    }
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "signal");
    return real(number, handler);
}

__attribute__((constructor)) static void start(void)
{
    struct sigaction action;
    dl_iterate_phdr(find_program, NULL);
    memset(&action, 0, sizeof action);
    action.sa_flags = SA_SIGINFO | SA_NODEFER;
    action.sa_sigaction = on_exception;
    sigaction(SIGFPE, &action, NULL);
    action.sa_sigaction = behind_step;
    sigaction(SIGTRAP, &action, NULL);
    feenableexcept(TRAPS);
}
