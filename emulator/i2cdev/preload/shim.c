/* Provides an emulated /dev/i2c-N to a dynamically linked program, by LD_PRELOAD.
 *
 * The environment has the number of the bus (CUBESTACK_I2C_BUS) and the emulation's socket
 * (CUBESTACK_I2C_SOCKET). Each opened device file is a separate connection, so the kernel counts its
 * copies; the emulation identifies it by its inode, in all processes. Calls use another connection,
 * one per process. Constants such as MAX_MESSAGE_BYTES are defined by shim.py, from
 * firmware_model/formats/linux_i2c.py.
 */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
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
    X(open) X(openat) X(ioctl) X(read) X(write) X(fopen) X(fstat) X(fstatat) X(statx) X(access) \
    X(faccessat) X(getxattr) X(lgetxattr)
#define DECLARE(name) static __typeof__(name) *real_##name;
#define LOOK_UP(name) real_##name = dlsym(RTLD_NEXT, #name);
OVERRIDDEN(DECLARE)

static int inode_of(int fd, ino_t *inode, mode_t *mode)
{
    struct stat found;
    if (syscall(SYS_fstat, fd, &found)) return -1; /* fstat is overridden here */
    *inode = found.st_ino;
    *mode = found.st_mode;
    return 0;
}

/* Key of a device file; 0 for any other descriptor. */
static uint64_t key_of(int fd)
{
    ino_t inode;
    mode_t mode;
    int saved = errno;
    uint64_t key = 0;
    if (config.on && !inode_of(fd, &inode, &mode) && S_ISSOCK(mode)) {
        struct sockaddr_un peer = {0};
        socklen_t size = sizeof peer;
        if (!getpeername(fd, (struct sockaddr *)&peer, &size) && peer.sun_family == AF_UNIX &&
            !strncmp(peer.sun_path, config.socket, sizeof peer.sun_path))
            key = inode;
    }
    errno = saved;
    return key;
}

/* Whether the connection still exists: a program may close it, and reuse its number. */
static bool channel_is_ours(void)
{
    ino_t inode;
    mode_t mode;
    return channel >= 0 && !inode_of(channel, &inode, &mode) && inode == channel_inode;
}

static void forget_channel(void)
{
    pthread_mutex_init(&lock, NULL);
    if (channel_is_ours()) close(channel);
    channel = -1;
}

static void hold(void) { pthread_mutex_lock(&lock); }
static void release(void) { pthread_mutex_unlock(&lock); }

__attribute__((constructor)) static void prepare(void)
{
    if (config.ready) return;
    config.ready = true;
    OVERRIDDEN(LOOK_UP)
    const char *bus = getenv("CUBESTACK_I2C_BUS"), *path = getenv("CUBESTACK_I2C_SOCKET");
    if (!bus || !path || strlen(path) >= sizeof config.socket) return;
    config.bus = atoi(bus);
    snprintf(config.device, sizeof config.device, "/dev/i2c-%d", config.bus);
    snprintf(config.name, sizeof config.name, "i2c-%d", config.bus);
    strcpy(config.socket, path);
    config.on = true;
    pthread_atfork(hold, release, forget_channel);
}

/* Whether a path, relative to a folder's descriptor, names the device file. */
static bool is_device(int folder, const char *path)
{
    prepare();
    if (!config.on || !path) return false;
    if (!strcmp(path, config.device)) return true;
    size_t length = strlen(path), tail = strlen(config.name);
    if (length < tail || strcmp(path + length - tail, config.name)) return false;
    if (length > tail && path[length - tail - 1] != '/') return false;
    char joined[PATH_MAX], real[PATH_MAX];
    int head = (int)(length - tail), saved = errno;
    if (path[0] == '/' || folder == AT_FDCWD)
        snprintf(joined, sizeof joined, "%.*s.", head, path);
    else
        snprintf(joined, sizeof joined, "/proc/self/fd/%d/%.*s.", folder, head, path);
    bool found = realpath(joined, real) && !strcmp(real, "/dev");
    errno = saved;
    return found;
}

static int connect_bus(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    strcpy(address.sun_path, config.socket);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd >= 0 && connect(fd, (struct sockaddr *)&address, sizeof address)) {
        close(fd);
        errno = ENODEV;
        return -1;
    }
    return fd;
}

static int send_all(int fd, struct iovec *parts, size_t count)
{
    struct msghdr message = {.msg_iov = parts, .msg_iovlen = count};
    while (message.msg_iovlen) {
        ssize_t sent = sendmsg(fd, &message, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent < 0) return -1;
        while (message.msg_iovlen && (size_t)sent >= message.msg_iov->iov_len) {
            sent -= message.msg_iov->iov_len;
            message.msg_iov++;
            message.msg_iovlen--;
        }
        if (message.msg_iovlen) {
            message.msg_iov->iov_base = (char *)message.msg_iov->iov_base + sent;
            message.msg_iov->iov_len -= sent;
        }
    }
    return 0;
}

static int receive_all(int fd, void *buffer, size_t count)
{
    while (count) {
        ssize_t got = recv(fd, buffer, count, 0);
        if (got < 0 && errno == EINTR) continue;
        if (got == 0) errno = EIO;
        if (got <= 0) return -1;
        buffer = (char *)buffer + got;
        count -= got;
    }
    return 0;
}

/* This process's connection; opened again if the program closed it or reused its number. */
static int open_channel(void)
{
    if (channel_is_ours()) return channel;
    channel = -1;
    int fd = connect_bus();
    if (fd < 0) return -1;
    int high = fcntl(fd, F_DUPFD_CLOEXEC, HIGH_NUMBER);
    if (high >= 0) {
        close(fd);
        fd = high;
    }
    mode_t mode;
    inode_of(fd, &channel_inode, &mode);
    return channel = fd;
}

/* Destination of a reply's data: the buffers of messages, or one buffer. */
struct sink {
    void *buffer;
    struct i2c_msg *messages;
    unsigned count;
};

static int take(int fd, void *buffer, size_t count, size_t *left)
{
    if (count > *left) {
        errno = EPROTO;
        return -1;
    }
    *left -= count;
    return receive_all(fd, buffer, count);
}

static int receive_data(int fd, const struct sink *sink, size_t left)
{
    if (!sink->messages) return take(fd, sink->buffer, left, &left);
    for (unsigned i = 0; i < sink->count && left; i++) {
        struct i2c_msg *message = &sink->messages[i];
        if (!(message->flags & I2C_M_RD)) continue;
        size_t length = message->len, first = 0;
        if (message->flags & I2C_M_RECV_LEN) {
            size_t extra = message->buf[0];
            if (take(fd, message->buf, first = 1, &left)) return -1;
            length = extra + message->buf[0];
        }
        if (take(fd, message->buf + first, length - first, &left)) return -1;
    }
    return 0;
}

/* Performs a call on the bus; parts[0] is reserved for its head. Returns as a system call. */
static int perform(uint64_t key, int call, struct iovec *parts, size_t count, struct sink sink)
{
    struct head head = {.key = key, .call = (uint8_t)call};
    size_t length = sizeof head - sizeof head.length;
    for (size_t i = 1; i < count; i++) length += parts[i].iov_len;
    head.length = (uint32_t)length;
    parts[0] = (struct iovec){&head, sizeof head};
    struct tail tail = {0};
    pthread_mutex_lock(&lock);
    int fd = open_channel();
    bool done = fd >= 0 && !send_all(fd, parts, count) && !receive_all(fd, &tail, sizeof tail) &&
                !receive_data(fd, &sink, tail.length - sizeof tail.result);
    int failure = errno;
    if (!done && fd >= 0) {
        close(fd); /* it may still carry data of this call */
        channel = -1;
        if (failure == EPIPE || failure == ECONNRESET) failure = EIO;
    }
    pthread_mutex_unlock(&lock);
    if (done && tail.result >= 0) return tail.result;
    errno = done ? -tail.result : failure;
    return -1;
}

static int open_device(int flags)
{
    if (flags & O_DIRECTORY) {
        errno = ENOTDIR;
        return -1;
    }
    int fd = connect_bus();
    if (fd < 0) return -1;
    ino_t inode = 0;
    mode_t mode;
    inode_of(fd, &inode, &mode);
    struct head head = {sizeof head - sizeof head.length, inode, CALL_OPEN};
    struct iovec part = {&head, sizeof head};
    struct tail tail;
    if (send_all(fd, &part, 1) || receive_all(fd, &tail, sizeof tail)) {
        close(fd);
        errno = ENODEV;
        return -1;
    }
    if (!(flags & O_CLOEXEC)) fcntl(fd, F_SETFD, 0);
    return fd;
}

static int rdwr(uint64_t key, struct i2c_rdwr_ioctl_data *argument)
{
    struct message_head heads[I2C_RDWR_IOCTL_MAX_MSGS];
    struct iovec parts[1 + 2 * I2C_RDWR_IOCTL_MAX_MSGS];
    size_t count = 1;
    if (!argument->msgs || !argument->nmsgs || argument->nmsgs > I2C_RDWR_IOCTL_MAX_MSGS) {
        errno = EINVAL;
        return -1;
    }
    for (unsigned i = 0; i < argument->nmsgs; i++) {
        struct i2c_msg *message = &argument->msgs[i];
        size_t sent = message->len <= MAX_MESSAGE_BYTES ? message->len : 0;
        if (message->flags & I2C_M_RD) sent = message->flags & I2C_M_RECV_LEN ? sent > 0 : 0;
        heads[i] = (struct message_head){message->addr, message->flags, message->len, sent};
        parts[count++] = (struct iovec){&heads[i], sizeof heads[i]};
        if (sent) parts[count++] = (struct iovec){message->buf, sent};
    }
    return perform(key, CALL_RDWR, parts, count, (struct sink){0, argument->msgs, argument->nmsgs});
}

static int smbus(uint64_t key, struct i2c_smbus_ioctl_data *argument)
{
    struct {
        uint8_t direction, command, given, pad;
        uint32_t size;
        uint8_t data[SMBUS_DATA_BYTES];
    } __attribute__((packed)) body = {argument->read_write, argument->command, 0, 0, argument->size, {0}};
    size_t used = sizeof body.data;
    if (body.size == I2C_SMBUS_BYTE || body.size == I2C_SMBUS_BYTE_DATA) used = 1;
    if (body.size == I2C_SMBUS_WORD_DATA || body.size == I2C_SMBUS_PROC_CALL) used = 2;
    if (argument->data) {
        body.given = 1;
        memcpy(body.data, argument->data, used);
    }
    struct iovec parts[2] = {{0}, {&body, sizeof body}};
    return perform(key, CALL_SMBUS, parts, 2, (struct sink){argument->data, 0, 0});
}

static int control(uint64_t key, unsigned long number, void *argument)
{
    if (number == I2C_RDWR) return rdwr(key, argument);
    if (number == I2C_SMBUS) return smbus(key, argument);
    struct {
        uint32_t number;
        uint64_t argument;
    } __attribute__((packed)) body = {(uint32_t)number, (uintptr_t)argument};
    struct iovec parts[2] = {{0}, {&body, sizeof body}};
    return perform(key, CALL_IOCTL, parts, 2, (struct sink){argument, 0, 0});
}

static void describe(struct stat *found)
{
    memset(found, 0, sizeof *found);
    found->st_mode = S_IFCHR | 0660;
    found->st_nlink = 1;
    found->st_ino = (1u << 31) + (unsigned)config.bus;
    found->st_uid = getuid();
    found->st_gid = getgid();
    found->st_rdev = makedev(I2C_MAJOR, config.bus);
    found->st_blksize = 4096;
}

/* --- overridden functions --------------------------------------------------------------------- */

#define MODE_OF(flags, last)                                                                       \
    mode_t mode = 0;                                                                               \
    if ((flags) & (O_CREAT | O_TMPFILE)) {                                                         \
        va_list list;                                                                              \
        va_start(list, last);                                                                      \
        mode = va_arg(list, mode_t);                                                               \
        va_end(list);                                                                              \
    }

int open(const char *path, int flags, ...)
{
    MODE_OF(flags, flags)
    return is_device(AT_FDCWD, path) ? open_device(flags) : real_open(path, flags, mode);
}

int openat(int folder, const char *path, int flags, ...)
{
    MODE_OF(flags, flags)
    return is_device(folder, path) ? open_device(flags) : real_openat(folder, path, flags, mode);
}

int open64(const char *path, int flags, ...)
{
    MODE_OF(flags, flags)
    return open(path, flags | O_LARGEFILE, mode);
}

int openat64(int folder, const char *path, int flags, ...)
{
    MODE_OF(flags, flags)
    return openat(folder, path, flags | O_LARGEFILE, mode);
}

int __open_2(const char *path, int flags) { return open(path, flags); }
int __open64_2(const char *path, int flags) { return open64(path, flags); }
int __openat_2(int folder, const char *path, int flags) { return openat(folder, path, flags); }
int __openat64_2(int folder, const char *path, int flags) { return openat64(folder, path, flags); }

int ioctl(int fd, unsigned long number, ...)
{
    va_list list;
    va_start(list, number);
    void *argument = va_arg(list, void *);
    va_end(list);
    prepare();
    uint32_t plain = (uint32_t)number; /* some programs pass an int */
    bool ours = (plain >= I2C_RETRIES && plain <= I2C_PEC) || plain == I2C_SMBUS;
    uint64_t key = ours ? key_of(fd) : 0;
    return key ? control(key, plain, argument) : real_ioctl(fd, number, argument);
}

ssize_t read(int fd, void *buffer, size_t count)
{
    prepare();
    uint64_t key = key_of(fd), wanted = count;
    if (!key) return real_read(fd, buffer, count);
    struct iovec parts[2] = {{0}, {&wanted, sizeof wanted}};
    return perform(key, CALL_READ, parts, 2, (struct sink){buffer, 0, 0});
}

ssize_t write(int fd, const void *buffer, size_t count)
{
    prepare();
    uint64_t key = key_of(fd);
    if (!key) return real_write(fd, buffer, count);
    struct iovec parts[2] = {
        {0}, {(void *)buffer, count < MAX_MESSAGE_BYTES ? count : MAX_MESSAGE_BYTES}};
    return perform(key, CALL_WRITE, parts, 2, (struct sink){0});
}

ssize_t __read_chk(int fd, void *buffer, size_t count, size_t size)
{
    if (count > size) abort();
    return read(fd, buffer, count);
}

/* i2c-tools read the list of busses with fopen. */
FILE *fopen(const char *path, const char *how)
{
    prepare();
    if (!config.on || strcmp(path, LISTING)) return real_fopen(path, how);
    char text[128];
    snprintf(text, sizeof text, LISTING_FORMAT, config.bus);
    FILE *file = fmemopen(NULL, strlen(text) + 1, "w+");
    if (file) {
        fputs(text, file);
        rewind(file);
    }
    return file;
}

FILE *fopen64(const char *path, const char *how) { return fopen(path, how); }

int fstat(int fd, struct stat *found)
{
    prepare();
    if (!key_of(fd)) return real_fstat(fd, found);
    describe(found);
    return 0;
}

int fstatat(int folder, const char *path, struct stat *found, int flags)
{
    if (is_device(folder, path) || (flags & AT_EMPTY_PATH && !*path && key_of(folder))) {
        describe(found);
        return 0;
    }
    return real_fstatat(folder, path, found, flags);
}

int stat(const char *path, struct stat *found) { return fstatat(AT_FDCWD, path, found, 0); }

int lstat(const char *path, struct stat *found)
{
    return fstatat(AT_FDCWD, path, found, AT_SYMLINK_NOFOLLOW);
}

_Static_assert(sizeof(struct stat) == sizeof(struct stat64), "a machine of 64 bits");
int fstat64(int fd, struct stat64 *found) { return fstat(fd, (struct stat *)found); }
int stat64(const char *path, struct stat64 *found) { return stat(path, (struct stat *)found); }
int lstat64(const char *path, struct stat64 *found) { return lstat(path, (struct stat *)found); }
int fstatat64(int folder, const char *path, struct stat64 *found, int flags)
{
    return fstatat(folder, path, (struct stat *)found, flags);
}

int statx(int folder, const char *path, int flags, unsigned mask, struct statx *found)
{
    if (!is_device(folder, path) && !(flags & AT_EMPTY_PATH && !*path && key_of(folder)))
        return real_statx(folder, path, flags, mask, found);
    struct stat plain;
    describe(&plain);
    memset(found, 0, sizeof *found);
    found->stx_mask = STATX_BASIC_STATS;
    found->stx_mode = (uint16_t)plain.st_mode;
    found->stx_nlink = 1;
    found->stx_ino = plain.st_ino;
    found->stx_uid = plain.st_uid;
    found->stx_gid = plain.st_gid;
    found->stx_blksize = (uint32_t)plain.st_blksize;
    found->stx_rdev_major = I2C_MAJOR;
    found->stx_rdev_minor = (uint32_t)config.bus;
    return 0;
}

int access(const char *path, int how)
{
    return is_device(AT_FDCWD, path) ? 0 : real_access(path, how);
}

int faccessat(int folder, const char *path, int how, int flags)
{
    return is_device(folder, path) ? 0 : real_faccessat(folder, path, how, flags);
}

static ssize_t no_attribute(void)
{
    errno = EOPNOTSUPP;
    return -1;
}

ssize_t getxattr(const char *path, const char *name, void *value, size_t size)
{
    return is_device(AT_FDCWD, path) ? no_attribute() : real_getxattr(path, name, value, size);
}

ssize_t lgetxattr(const char *path, const char *name, void *value, size_t size)
{
    return is_device(AT_FDCWD, path) ? no_attribute() : real_lgetxattr(path, name, value, size);
}
