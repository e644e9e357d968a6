/* Provides an emulated /dev/i2c-N to a dynamically linked program, by LD_PRELOAD.
 *
 * The environment has the number of the bus (CUBESTACK_I2C_BUS) and the emulation's socket
 * (CUBESTACK_I2C_SOCKET). Each opened device file is a separate connection, so the kernel counts its
 * copies; the emulation identifies it by its inode, in all processes. Calls use another connection,
 * one per process. Constants such as MAX_MESSAGE_BYTES are defined by shim.py, from
 * firmware_model/formats/linux_i2c.py. A descriptor of a device file is a socket that is shut for
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

static int inode_of(int fd, ino_t *inode, mode_t *mode)
{
    struct stat found;
    if (real_fstat(fd, &found)) return -1;
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

/* Descriptor that a link in /proc names, of a process itself; -1 for any other path. */
static int own_descriptor(const char *path)
{
    static const char *const heads[] = {"/proc/self/fd/%d%n", "/proc/thread-self/fd/%d%n", "/dev/fd/%d%n"};
    char own[32];
    int fd, used;
    for (size_t i = 0; i < 3; i++) {
        used = 0;
        if (sscanf(path, heads[i], &fd, &used) == 1 && used && !path[used]) return fd;
    }
    snprintf(own, sizeof own, "/proc/%d/fd/%%d%%n", getpid());
    used = 0;
    if (sscanf(path, own, &fd, &used) == 1 && used && !path[used]) return fd;
    if (!strcmp(path, "/dev/stdin")) return 0;
    if (!strcmp(path, "/dev/stdout")) return 1;
    return strcmp(path, "/dev/stderr") ? -1 : 2;
}

/* Whether a path, relative to a folder's descriptor, is that of the device file. */
static bool names_device(int folder, const char *path)
{
    if (!strcmp(path, config.device)) return true;
    size_t length = strlen(path), tail = strlen(config.name);
    if (length < tail || strcmp(path + length - tail, config.name)) return false;
    if (length > tail && path[length - tail - 1] != '/') return false;
    char joined[PATH_MAX], real[PATH_MAX];
    int head = (int)(length - tail);
    if (path[0] == '/' || folder == AT_FDCWD)
        snprintf(joined, sizeof joined, "%.*s.", head, path);
    else
        snprintf(joined, sizeof joined, "/proc/self/fd/%d/%.*s.", folder, head, path);
    return real_realpath(joined, real) && !strcmp(real, "/dev");
}

/* Whether a path leads to the device file; follow: also by a symbolic link at its end. */
static bool leads_to_device(int folder, const char *path, bool follow)
{
    prepare();
    if (!config.on || !path) return false;
    char at[PATH_MAX], target[PATH_MAX];
    int saved = errno;
    bool found = false;
    for (int i = 0; i < MAX_LINKS && !(found = names_device(folder, path)) && follow; i++) {
        int opened = own_descriptor(path);
        if (opened >= 0) {
            found = key_of(opened);
            break;
        }
        ssize_t length = real_readlinkat(folder, path, target, sizeof target - 1);
        if (length < 0) break;
        target[length] = 0;
        const char *slash = strrchr(path, '/');
        char next[2 * PATH_MAX];
        if (target[0] == '/' || !slash)
            snprintf(next, sizeof next, "%s", target);
        else
            snprintf(next, sizeof next, "%.*s%s", (int)(slash + 1 - path), path, target);
        if (strlen(next) >= sizeof at) break;
        path = strcpy(at, next);
    }
    errno = saved;
    return found;
}

static bool is_device(int folder, const char *path) { return leads_to_device(folder, path, true); }

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

static int failed(int number)
{
    errno = number;
    return -1;
}

/* Copies memory whose address the program gave; EFAULT where there is none. */
static int fetch(void *to, const void *from, size_t count)
{
    struct iovec here = {to, count}, there = {(void *)from, count};
    if (!count) return 0;
    ssize_t got = process_vm_readv(getpid(), &here, 1, &there, 1, 0);
    if (got < 0 && errno != EFAULT) { /* the call is forbidden */
        memcpy(to, from, count);
        return 0;
    }
    return got == (ssize_t)count ? 0 : failed(EFAULT);
}

static int open_device(int flags)
{
    if (!(flags & O_PATH) && (flags & O_CREAT) && (flags & O_EXCL)) return failed(EEXIST);
    if (flags & O_DIRECTORY) return failed(ENOTDIR);
    if ((flags & O_DIRECT) && !(flags & O_PATH)) return failed(EINVAL);
    int fd = connect_bus();
    if (fd < 0) return -1;
    ino_t inode = 0;
    mode_t mode;
    inode_of(fd, &inode, &mode);
    uint32_t chosen = (uint32_t)flags;
    struct head head = {sizeof head - sizeof head.length + sizeof chosen, inode, CALL_OPEN};
    struct iovec parts[2] = {{&head, sizeof head}, {&chosen, sizeof chosen}};
    struct tail tail = {0, -ENODEV};
    send_all(fd, parts, 2); /* a server without room for it has sent its answer already */
    if (receive_all(fd, &tail, sizeof tail) || tail.result < 0) {
        close(fd);
        return failed(-tail.result);
    }
    shutdown(fd, SHUT_RD); /* so that poll says that it is readable, as in Linux */
    if (!(flags & O_CLOEXEC)) real_fcntl(fd, F_SETFD, 0);
    if (flags & O_NONBLOCK) real_fcntl(fd, F_SETFL, O_NONBLOCK);
    return fd;
}

static int rdwr(uint64_t key, const void *place)
{
    struct i2c_rdwr_ioctl_data argument;
    struct i2c_msg messages[I2C_RDWR_IOCTL_MAX_MSGS];
    struct message_head heads[I2C_RDWR_IOCTL_MAX_MSGS];
    struct iovec parts[1 + 2 * I2C_RDWR_IOCTL_MAX_MSGS];
    size_t count = 1;
    if (fetch(&argument, place, sizeof argument)) return -1;
    if (!argument.msgs || !argument.nmsgs || argument.nmsgs > I2C_RDWR_IOCTL_MAX_MSGS)
        return failed(EINVAL);
    if (fetch(messages, argument.msgs, argument.nmsgs * sizeof *messages)) return -1;
    for (unsigned i = 0; i < argument.nmsgs; i++) {
        struct i2c_msg *message = &messages[i];
        uint8_t byte;
        size_t sent = message->len <= MAX_MESSAGE_BYTES ? message->len : 0;
        if (sent && (fetch(&byte, message->buf, 1) || fetch(&byte, message->buf + sent - 1, 1)))
            return -1;
        if (message->flags & I2C_M_RD) sent = message->flags & I2C_M_RECV_LEN ? sent > 0 : 0;
        heads[i] = (struct message_head){message->addr, message->flags, message->len, sent};
        parts[count++] = (struct iovec){&heads[i], sizeof heads[i]};
        if (sent) parts[count++] = (struct iovec){message->buf, sent};
    }
    return perform(key, CALL_RDWR, parts, count, (struct sink){0, messages, argument.nmsgs});
}

static int smbus(uint64_t key, const void *place)
{
    struct i2c_smbus_ioctl_data argument;
    if (fetch(&argument, place, sizeof argument)) return -1;
    struct {
        uint8_t direction, command, given, pad;
        uint32_t size;
        uint8_t data[SMBUS_DATA_BYTES];
    } __attribute__((packed)) body = {argument.read_write, argument.command, 0, 0, argument.size, {0}};
    size_t used = sizeof body.data;
    if (body.size == I2C_SMBUS_BYTE || body.size == I2C_SMBUS_BYTE_DATA) used = 1;
    if (body.size == I2C_SMBUS_WORD_DATA || body.size == I2C_SMBUS_PROC_CALL) used = 2;
    if (argument.data) {
        body.given = 1;
        if (fetch(body.data, argument.data, used)) return -1;
    }
    struct iovec parts[2] = {{0}, {&body, sizeof body}};
    return perform(key, CALL_SMBUS, parts, 2, (struct sink){argument.data, 0, 0});
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
    found->st_mode = MODE;
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
    bool ours = leads_to_device(AT_FDCWD, path, !(flags & O_NOFOLLOW));
    return ours ? open_device(flags) : real_open(path, flags, mode);
}

int openat(int folder, const char *path, int flags, ...)
{
    MODE_OF(flags, flags)
    bool ours = leads_to_device(folder, path, !(flags & O_NOFOLLOW));
    return ours ? open_device(flags) : real_openat(folder, path, flags, mode);
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

int creat(const char *path, mode_t mode)
{
    return open(path, O_CREAT | O_WRONLY | O_TRUNC, mode);
}

int creat64(const char *path, mode_t mode) { return creat(path, mode); }
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
    bool of_sockets = plain == FIONREAD || plain == TIOCOUTQ || plain == FIOASYNC ||
                      (plain & ~0xFFu) == 0x8900;
    uint64_t key = ours || of_sockets ? key_of(fd) : 0;
    if (!key) return real_ioctl(fd, number, argument);
    return ours ? control(key, plain, argument) : failed(ENOTTY);
}

static ssize_t read_device(uint64_t key, void *buffer, size_t count)
{
    uint64_t wanted = count;
    struct iovec parts[2] = {{0}, {&wanted, sizeof wanted}};
    return perform(key, CALL_READ, parts, 2, (struct sink){buffer, 0, 0});
}

static ssize_t write_device(uint64_t key, const void *buffer, size_t count)
{
    struct iovec parts[2] = {
        {0}, {(void *)buffer, count < MAX_MESSAGE_BYTES ? count : MAX_MESSAGE_BYTES}};
    return perform(key, CALL_WRITE, parts, 2, (struct sink){0});
}

/* Each part of a vector is a call of its own, until one is short or fails, as in Linux. */
static ssize_t move_parts(uint64_t key, const struct iovec *parts, int count, bool reading)
{
    if (count < 0 || count > IOV_MAX) return failed(EINVAL);
    struct iovec part;
    ssize_t total = 0;
    for (int i = 0; i < count; i++) {
        if (fetch(&part, &parts[i], sizeof part)) return -1;
        if ((ssize_t)part.iov_len < 0) return failed(EINVAL);
        if (part.iov_len) total = i + 1;
    }
    count = (int)total; /* empty parts at the end do nothing */
    total = 0;
    for (int i = 0; i < count; i++) {
        ssize_t moved = reading ? read_device(key, parts[i].iov_base, parts[i].iov_len)
                                : write_device(key, parts[i].iov_base, parts[i].iov_len);
        if (moved < 0) return total ? total : -1;
        total += moved;
        if ((size_t)moved != parts[i].iov_len) break;
    }
    return total;
}

ssize_t read(int fd, void *buffer, size_t count)
{
    prepare();
    uint64_t key = key_of(fd);
    return key ? read_device(key, buffer, count) : real_read(fd, buffer, count);
}

ssize_t write(int fd, const void *buffer, size_t count)
{
    prepare();
    uint64_t key = key_of(fd);
    return key ? write_device(key, buffer, count) : real_write(fd, buffer, count);
}

/* Linux ignores the offset, unless it is negative. */
ssize_t pread(int fd, void *buffer, size_t count, off_t offset)
{
    prepare();
    uint64_t key = key_of(fd);
    if (!key) return real_pread(fd, buffer, count, offset);
    return offset < 0 ? failed(EINVAL) : read_device(key, buffer, count);
}

ssize_t pwrite(int fd, const void *buffer, size_t count, off_t offset)
{
    prepare();
    uint64_t key = key_of(fd);
    if (!key) return real_pwrite(fd, buffer, count, offset);
    return offset < 0 ? failed(EINVAL) : write_device(key, buffer, count);
}

ssize_t pread64(int fd, void *buffer, size_t count, off64_t offset)
{
    return pread(fd, buffer, count, offset);
}

ssize_t pwrite64(int fd, const void *buffer, size_t count, off64_t offset)
{
    return pwrite(fd, buffer, count, offset);
}

ssize_t readv(int fd, const struct iovec *parts, int count)
{
    prepare();
    uint64_t key = key_of(fd);
    return key ? move_parts(key, parts, count, true) : real_readv(fd, parts, count);
}

ssize_t writev(int fd, const struct iovec *parts, int count)
{
    prepare();
    uint64_t key = key_of(fd);
    return key ? move_parts(key, parts, count, false) : real_writev(fd, parts, count);
}

ssize_t preadv(int fd, const struct iovec *parts, int count, off_t offset)
{
    prepare();
    uint64_t key = key_of(fd);
    if (!key) return real_preadv(fd, parts, count, offset);
    return offset < 0 ? failed(EINVAL) : move_parts(key, parts, count, true);
}

ssize_t pwritev(int fd, const struct iovec *parts, int count, off_t offset)
{
    prepare();
    uint64_t key = key_of(fd);
    if (!key) return real_pwritev(fd, parts, count, offset);
    return offset < 0 ? failed(EINVAL) : move_parts(key, parts, count, false);
}

static ssize_t move_with_flags(
    uint64_t key, const struct iovec *parts, int count, off_t offset, int flags, bool reading)
{
    if (offset < -1) return failed(EINVAL);
    return flags & ~RWF_HIPRI ? failed(EOPNOTSUPP) : move_parts(key, parts, count, reading);
}

ssize_t preadv2(int fd, const struct iovec *parts, int count, off_t offset, int flags)
{
    prepare();
    uint64_t key = key_of(fd);
    if (!key) return real_preadv2(fd, parts, count, offset, flags);
    return move_with_flags(key, parts, count, offset, flags, true);
}

ssize_t pwritev2(int fd, const struct iovec *parts, int count, off_t offset, int flags)
{
    prepare();
    uint64_t key = key_of(fd);
    if (!key) return real_pwritev2(fd, parts, count, offset, flags);
    return move_with_flags(key, parts, count, offset, flags, false);
}

ssize_t preadv64(int fd, const struct iovec *parts, int count, off64_t offset)
{
    return preadv(fd, parts, count, offset);
}

ssize_t pwritev64(int fd, const struct iovec *parts, int count, off64_t offset)
{
    return pwritev(fd, parts, count, offset);
}

ssize_t preadv64v2(int fd, const struct iovec *parts, int count, off64_t offset, int flags)
{
    return preadv2(fd, parts, count, offset, flags);
}

ssize_t pwritev64v2(int fd, const struct iovec *parts, int count, off64_t offset, int flags)
{
    return pwritev2(fd, parts, count, offset, flags);
}

int fcntl(int fd, int command, ...)
{
    va_list list;
    va_start(list, command);
    void *argument = va_arg(list, void *);
    va_end(list);
    prepare();
    uint64_t key = command == F_GETFL ? key_of(fd) : 0;
    int flags = real_fcntl(fd, command, argument);
    if (!key || flags < 0) return flags;
    struct iovec part;
    int mode = perform(key, CALL_MODE, &part, 1, (struct sink){0});
    if (mode < 0 || mode & O_PATH) return mode;
    return (flags & ~MODE_FLAGS) | mode;
}

int fcntl64(int fd, int command, ...)
{
    va_list list;
    va_start(list, command);
    void *argument = va_arg(list, void *);
    va_end(list);
    return fcntl(fd, command, argument);
}

int epoll_ctl(int poller, int how, int fd, struct epoll_event *event)
{
    prepare();
    return key_of(fd) ? failed(EPERM) : real_epoll_ctl(poller, how, fd, event);
}

ssize_t sendfile(int out, int in, off_t *offset, size_t count)
{
    prepare();
    return key_of(out) || key_of(in) ? failed(EINVAL) : real_sendfile(out, in, offset, count);
}

ssize_t sendfile64(int out, int in, off64_t *offset, size_t count)
{
    return sendfile(out, in, offset, count);
}

ssize_t splice(int in, off64_t *from, int out, off64_t *to, size_t count, unsigned flags)
{
    prepare();
    return key_of(out) || key_of(in) ? failed(EINVAL) : real_splice(in, from, out, to, count, flags);
}

ssize_t copy_file_range(int in, off64_t *from, int out, off64_t *to, size_t count, unsigned flags)
{
    prepare();
    if (key_of(out) || key_of(in)) return failed(EINVAL);
    return real_copy_file_range(in, from, out, to, count, flags);
}

/* Numbers that a program passes to syscall(2); io_uring would bypass this library. */
long syscall(long number, ...)
{
    va_list list;
    long a[6];
    va_start(list, number);
    for (int i = 0; i < 6; i++) a[i] = va_arg(list, long);
    va_end(list);
    prepare();
    switch (number) {
    case SYS_io_uring_setup: return failed(ENOSYS);
    case SYS_openat: return openat((int)a[0], (char *)a[1], (int)a[2], (mode_t)a[3]);
    case SYS_openat2: {
        struct open_how how;
        if (!config.on || (size_t)a[3] < sizeof how || fetch(&how, (void *)a[2], sizeof how)) break;
        bool follow = !(how.flags & O_NOFOLLOW) && !(how.resolve & RESOLVE_NO_SYMLINKS);
        bool bounded = how.resolve & (RESOLVE_NO_XDEV | RESOLVE_BENEATH | RESOLVE_IN_ROOT);
        if (bounded || !leads_to_device((int)a[0], (char *)a[1], follow)) break;
        return open_device((int)how.flags);
    }
    case SYS_ioctl: return ioctl((int)a[0], (unsigned long)a[1], (void *)a[2]);
    case SYS_read: return read((int)a[0], (void *)a[1], (size_t)a[2]);
    case SYS_write: return write((int)a[0], (void *)a[1], (size_t)a[2]);
    case SYS_fstat: return fstat((int)a[0], (struct stat *)a[1]);
    }
    return real_syscall(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

/* --- streams: the C library's own calls do not pass here, so they are given functions ----------- */

static struct {
    FILE *file;
    int fd;
} streams[MAX_OPENED];

static ssize_t read_stream(void *fd, char *buffer, size_t count)
{
    return read((int)(intptr_t)fd, buffer, count);
}

static ssize_t write_stream(void *fd, const char *buffer, size_t count)
{
    ssize_t done = write((int)(intptr_t)fd, buffer, count);
    return done < 0 ? 0 : done; /* as fopencookie wants it */
}

static int close_stream(void *fd) { return close((int)(intptr_t)fd); }

FILE *fdopen(int fd, const char *how)
{
    prepare();
    if (!key_of(fd)) return real_fdopen(fd, how);
    cookie_io_functions_t functions = {read_stream, write_stream, NULL, close_stream};
    for (int i = 0; i < MAX_OPENED; i++) {
        if (streams[i].file) continue;
        streams[i].file = fopencookie((void *)(intptr_t)fd, how, functions);
        streams[i].fd = fd;
        return streams[i].file;
    }
    errno = EMFILE;
    return NULL;
}

int fileno(FILE *file)
{
    prepare();
    for (int i = 0; i < MAX_OPENED; i++)
        if (streams[i].file == file) return streams[i].fd;
    return real_fileno(file);
}

int fileno_unlocked(FILE *file) { return fileno(file); }

int fclose(FILE *file)
{
    prepare();
    for (int i = 0; i < MAX_OPENED; i++)
        if (file && streams[i].file == file) streams[i].file = NULL;
    return real_fclose(file);
}

static FILE *open_stream(const char *how)
{
    int flags = how[0] == 'r' ? O_RDONLY : O_WRONLY;
    if (strchr(how, '+')) flags = O_RDWR;
    if (strchr(how, 'x')) flags |= O_CREAT | O_EXCL;
    if (strchr(how, 'e')) flags |= O_CLOEXEC;
    int fd = open_device(flags);
    FILE *file = fd < 0 ? NULL : fdopen(fd, how);
    if (fd >= 0 && !file) close(fd);
    return file;
}

ssize_t __read_chk(int fd, void *buffer, size_t count, size_t size)
{
    if (count > size) abort();
    return read(fd, buffer, count);
}

/* i2c-tools read the list of busses with fopen. */
FILE *fopen(const char *path, const char *how)
{
    if (is_device(AT_FDCWD, path)) return open_stream(how);
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
    if (leads_to_device(folder, path, !(flags & AT_SYMLINK_NOFOLLOW)) || (flags & AT_EMPTY_PATH && !*path && key_of(folder))) {
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
    if (!leads_to_device(folder, path, !(flags & AT_SYMLINK_NOFOLLOW)) &&
        !(flags & AT_EMPTY_PATH && !*path && key_of(folder)))
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

static int permitted(int how)
{
    if (how & ~(R_OK | W_OK | X_OK)) return failed(EINVAL);
    return how & X_OK && !(MODE & 0111) ? failed(EACCES) : 0;
}

int access(const char *path, int how)
{
    return is_device(AT_FDCWD, path) ? permitted(how) : real_access(path, how);
}

int faccessat(int folder, const char *path, int how, int flags)
{
    return is_device(folder, path) ? permitted(how) : real_faccessat(folder, path, how, flags);
}

ssize_t readlinkat(int folder, const char *path, char *target, size_t size)
{
    if (leads_to_device(folder, path, false)) return failed(EINVAL);
    int fd = config.on ? own_descriptor(path) : -1;
    if (fd < 0 || !strncmp(path, "/dev/std", 8) || !key_of(fd))
        return real_readlinkat(folder, path, target, size);
    if ((int)size <= 0) return failed(EINVAL);
    size_t length = strlen(config.device);
    if (length > size) length = size;
    memcpy(target, config.device, length);
    return (ssize_t)length;
}

ssize_t readlink(const char *path, char *target, size_t size)
{
    return readlinkat(AT_FDCWD, path, target, size);
}

ssize_t __readlink_chk(const char *path, char *target, size_t size, size_t room)
{
    if (size > room) abort();
    return readlink(path, target, size);
}

char *realpath(const char *path, char *real)
{
    if (!is_device(AT_FDCWD, path)) return real_realpath(path, real);
    return real ? strcpy(real, config.device) : strdup(config.device);
}

char *__realpath_chk(const char *path, char *real, size_t room)
{
    if (room < PATH_MAX) abort();
    return realpath(path, real);
}

char *canonicalize_file_name(const char *path) { return realpath(path, NULL); }

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
    return leads_to_device(AT_FDCWD, path, false) ? no_attribute() : real_lgetxattr(path, name, value, size);
}

/* --- listing ------------------------------------------------------------------------------------ */

static struct {
    DIR *folder;
    bool listed;
} folders[MAX_OPENED];

/* A folder that is /dev gets the device file as its last entry. */
static DIR *watch_folder(DIR *folder)
{
    struct stat found, dev;
    int saved = errno;
    if (config.on && folder && !real_fstat(dirfd(folder), &found) &&
        !real_fstatat(AT_FDCWD, "/dev", &dev, 0) && found.st_ino == dev.st_ino &&
        found.st_dev == dev.st_dev) {
        for (int i = 0; i < MAX_OPENED; i++) {
            if (folders[i].folder) continue;
            folders[i].listed = false;
            folders[i].folder = folder;
            break;
        }
    }
    errno = saved;
    return folder;
}

static int watched(const DIR *folder)
{
    for (int i = 0; i < MAX_OPENED; i++)
        if (folders[i].folder == folder) return i;
    return -1;
}

DIR *opendir(const char *path)
{
    prepare();
    return watch_folder(real_opendir(path));
}

DIR *fdopendir(int fd)
{
    prepare();
    return watch_folder(real_fdopendir(fd));
}

int closedir(DIR *folder)
{
    prepare();
    int i = watched(folder);
    if (i >= 0) folders[i].folder = NULL;
    return real_closedir(folder);
}

void rewinddir(DIR *folder)
{
    prepare();
    int i = watched(folder);
    if (i >= 0) folders[i].listed = false;
    real_rewinddir(folder);
}

struct dirent *readdir(DIR *folder)
{
    static struct dirent device;
    prepare();
    int i = watched(folder), before = errno;
    errno = 0;
    struct dirent *entry = real_readdir(folder);
    if (entry || i < 0 || errno || folders[i].listed) {
        if (!errno) errno = before;
        return entry;
    }
    errno = before;
    folders[i].listed = true;
    device.d_ino = (1u << 31) + (unsigned)config.bus;
    device.d_type = DT_CHR;
    device.d_reclen = sizeof device;
    strcpy(device.d_name, config.name);
    return &device;
}

_Static_assert(sizeof(struct dirent) == sizeof(struct dirent64), "a machine of 64 bits");
struct dirent64 *readdir64(DIR *folder) { return (struct dirent64 *)readdir(folder); }

int scandir(
    const char *path, struct dirent ***list, int (*wanted)(const struct dirent *),
    int (*compare)(const struct dirent **, const struct dirent **))
{
    DIR *folder = opendir(path);
    if (!folder) return -1;
    struct dirent **found = NULL, *entry;
    size_t count = 0;
    while ((entry = readdir(folder))) {
        if (wanted && !wanted(entry)) continue;
        size_t size = offsetof(struct dirent, d_name) + strlen(entry->d_name) + 1;
        struct dirent **longer = realloc(found, (count + 1) * sizeof *found);
        if (longer) found = longer;
        if (!longer || !(found[count] = malloc(size))) {
            while (count) free(found[--count]);
            free(found);
            closedir(folder);
            return failed(ENOMEM);
        }
        memcpy(found[count++], entry, size);
    }
    closedir(folder);
    if (compare && count)
        qsort(found, count, sizeof *found, (int (*)(const void *, const void *))compare);
    *list = found;
    return (int)count;
}

int scandir64(
    const char *path, struct dirent64 ***list, int (*wanted)(const struct dirent64 *),
    int (*compare)(const struct dirent64 **, const struct dirent64 **))
{
    return scandir(path, (void *)list, (void *)wanted, (void *)compare);
}

int glob(const char *pattern, int flags, int (*failure)(const char *, int), glob_t *found)
{
    prepare();
    if (!config.on || flags & GLOB_ALTDIRFUNC) return real_glob(pattern, flags, failure, found);
    found->gl_opendir = (void *(*)(const char *))opendir;
    found->gl_readdir = (struct dirent * (*)(void *)) readdir;
    found->gl_closedir = (void (*)(void *))closedir;
    found->gl_stat = stat;
    found->gl_lstat = lstat;
    return real_glob(pattern, flags | GLOB_ALTDIRFUNC, failure, found);
}

_Static_assert(sizeof(glob_t) == sizeof(glob64_t), "a machine of 64 bits");
int glob64(const char *pattern, int flags, int (*failure)(const char *, int), glob64_t *found)
{
    return glob(pattern, flags, failure, (glob_t *)found);
}
