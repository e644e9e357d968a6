/* Repeats calls that a signal ended before the supervisor received them; for LD_PRELOAD.
 *
 * The kernel ends such a call with EINTR if the signal's handler was installed without SA_RESTART. It has
 * not begun, and on Linux neither a device file of i2c-dev nor a file on a disk returns EINTR. Pipes,
 * sockets, terminals and whatever else blocks do, so calls on them are not repeated.
 *
 * Each function here has up to six integers or pointers as arguments. So the same wrapper, which passes six
 * registers on, fits all of them. It calls the C library, so that a thread can still be cancelled in it.
 * Works with glibc and musl.
 */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdbool.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/sysmacros.h>

#define I2C_MAJOR 89
#define HERE -100 /* AT_FDCWD; fcntl.h would declare the functions that are defined here */
#define DUPFD 0
#define GETFL 3
#define DUPFD_CLOEXEC 1030

typedef long function(long, long, long, long, long, long);

static bool failed_early(long result, long failure)
{
    return (int)result == failure && errno == EINTR;
}

static bool never_blocks(mode_t mode, unsigned device_major)
{
    return S_ISREG(mode) || S_ISDIR(mode) || (S_ISCHR(mode) && device_major == I2C_MAJOR);
}

/* Whether calls on a file never end with EINTR on Linux; so also to create one. */
static bool is_file(long folder, const char *path, int flags)
{
    static function *call; /* the system call itself: old C libraries have no function for it */
    if (!call) call = (function *)dlsym(RTLD_NEXT, "syscall");
    struct statx found;
    long result;
    do result = call(SYS_statx, folder, (long)path, flags, STATX_TYPE, (long)&found);
    while (failed_early(result, -1));
    bool file = result ? errno == ENOENT : never_blocks(found.stx_mode, found.stx_rdev_major);
    errno = EINTR;
    return file;
}

static bool has_file(long fd) { return is_file(fd, "", 0x1000 /* AT_EMPTY_PATH */); }

/* The label has the function's name, since C would compare the types. */
#define WRAP(name, failure, repeats)                                                               \
    long repeat_##name(long a, long b, long c, long d, long e, long f) __asm__(#name);             \
    long repeat_##name(long a, long b, long c, long d, long e, long f)                             \
    {                                                                                              \
        static function *call;                                                                     \
        if (!call) call = (function *)dlsym(RTLD_NEXT, #name);                                     \
        long result;                                                                               \
        do result = call(a, b, c, d, e, f);                                                        \
        while (failed_early(result, failure) && (repeats));                                        \
        return result;                                                                             \
    }
#define ALWAYS(name) WRAP(name, -1, true)
#define ON_DESCRIPTOR(name) WRAP(name, -1, has_file(a))
#define ON_TWO(name, other) WRAP(name, -1, has_file(a) && has_file(other))
#define OF_DESCRIPTOR(name) WRAP(name, -1, b == GETFL || b == DUPFD || b == DUPFD_CLOEXEC)
#define OPEN(name) WRAP(name, -1, is_file(HERE, (char *)a, 0))
#define OPEN_AT(name) WRAP(name, -1, is_file(a, (char *)b, 0))
#define OPEN_STREAM(name) WRAP(name, 0, is_file(HERE, (char *)a, 0))

OPEN(open) OPEN(open64) OPEN(__open_2) OPEN(__open64_2) OPEN(creat) OPEN(creat64)
OPEN_AT(openat) OPEN_AT(openat64) OPEN_AT(__openat_2) OPEN_AT(__openat64_2)
OPEN_STREAM(fopen) OPEN_STREAM(fopen64) OPEN_STREAM(opendir)

ON_DESCRIPTOR(ioctl)
ON_DESCRIPTOR(read) ON_DESCRIPTOR(__read_chk) ON_DESCRIPTOR(write)
ON_DESCRIPTOR(pread) ON_DESCRIPTOR(pread64) ON_DESCRIPTOR(__pread_chk) ON_DESCRIPTOR(__pread64_chk)
ON_DESCRIPTOR(pwrite) ON_DESCRIPTOR(pwrite64)
ON_DESCRIPTOR(readv) ON_DESCRIPTOR(preadv) ON_DESCRIPTOR(preadv64) ON_DESCRIPTOR(preadv2)
ON_DESCRIPTOR(preadv64v2) ON_DESCRIPTOR(writev) ON_DESCRIPTOR(pwritev) ON_DESCRIPTOR(pwritev64)
ON_DESCRIPTOR(pwritev2) ON_DESCRIPTOR(pwritev64v2)
ON_TWO(sendfile, b) ON_TWO(sendfile64, b) ON_TWO(copy_file_range, c)
OF_DESCRIPTOR(fcntl) OF_DESCRIPTOR(fcntl64)

ALWAYS(dup) ALWAYS(dup2) ALWAYS(dup3) ALWAYS(epoll_ctl)
ALWAYS(stat) ALWAYS(stat64) ALWAYS(lstat) ALWAYS(lstat64) ALWAYS(fstat) ALWAYS(fstat64)
ALWAYS(fstatat) ALWAYS(fstatat64) ALWAYS(statx)
ALWAYS(__xstat) ALWAYS(__xstat64) ALWAYS(__lxstat) ALWAYS(__lxstat64) ALWAYS(__fxstat)
ALWAYS(__fxstat64) ALWAYS(__fxstatat) ALWAYS(__fxstatat64)
ALWAYS(access) ALWAYS(faccessat) ALWAYS(euidaccess) ALWAYS(eaccess)
ALWAYS(readlink) ALWAYS(readlinkat) ALWAYS(__readlink_chk) ALWAYS(__readlinkat_chk)
ALWAYS(getxattr) ALWAYS(lgetxattr)
