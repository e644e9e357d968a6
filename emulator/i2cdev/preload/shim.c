/* Provides an emulated /dev/i2c-N to a dynamically linked program, by LD_PRELOAD.
 *
 * The environment has the number of the bus (CUBESTACK_I2C_BUS) and the emulation's socket
 * (CUBESTACK_I2C_SOCKET). Each opened device file is a separate connection, so the kernel counts its
 * copies; the emulation identifies it by its inode, in all processes. Calls use another connection,
 * one per process. Constants such as MAX_MESSAGE_BYTES are defined by shim.py, from
 * firmware_model/formats/i2c_socket.py. A descriptor of a device file is a socket that is shut for
 * reading; what a socket does as a device file does (poll, lseek, mmap, dup and so on) is left to the
 * kernel.
 */

#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <limits.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <linux/openat2.h>
#include <linux/sockios.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/sendfile.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/sysmacros.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <sys/xattr.h>
#include <unistd.h>

#define HIGH_NUMBER 500 /* first descriptor of our connections, above those that programs expect */
#define LISTING "/proc/bus/i2c"
#define I2C_MAJOR 89
#define MODE (S_IFCHR | 0660)
#define MAX_LINKS 40 /* symbolic links in a path */
#define MAX_OPENED 16 /* streams, and folders that are listed, at the same time */
#define MODE_FLAGS (O_ACCMODE | O_PATH)

struct head {
    uint32_t length;
    uint64_t key;
    uint8_t call;
} __attribute__((packed));

struct tail {
    uint32_t length;
    int32_t result;
};

struct message_head {
    uint16_t address, flags, length, sent;
};

static struct {
    bool ready, on;
    char device[32], name[16], socket[sizeof(((struct sockaddr_un *)0)->sun_path)];
    int bus;
} config;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int channel = -1;
static ino_t channel_inode;

/* The functions of the C library that are overridden here. */
#define OVERRIDDEN(X) \
    X(open) X(openat) X(ioctl) X(read) X(write) X(pread) X(pwrite) X(readv) X(writev) X(preadv) \
    X(pwritev) X(preadv2) X(pwritev2) X(fcntl) X(epoll_ctl) X(sendfile) X(splice) \
    X(copy_file_range) X(fopen) X(fdopen) X(fileno) X(fclose) X(fstat) X(fstatat) X(statx) \
    X(access) X(faccessat) X(readlink) X(readlinkat) X(realpath) X(getxattr) X(lgetxattr) \
    X(opendir) X(fdopendir) X(readdir) X(rewinddir) X(closedir) X(glob) X(syscall)
#define DECLARE(name) static __typeof__(name) *real_##name;
#define LOOK_UP(name) real_##name = dlsym(RTLD_NEXT, #name);
OVERRIDDEN(DECLARE)

#include "connection.c"
#include "paths.c"
#include "device.c"
#include "opening.c"
#include "transfers.c"
#include "streams.c"
#include "status.c"
#include "listing.c"
