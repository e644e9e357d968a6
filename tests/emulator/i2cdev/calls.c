/* Makes every call of emulator/i2cdev/calls.py on /dev/i2c-7; prints "name<TAB>result" per call.
 *
 * The target at 0x1A has 256 registers behind a pointer. A result is a number, the name of an errno,
 * or "ok" for what is checked here (a descriptor, a file status, a path).
 */
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <linux/fs.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <linux/openat2.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/select.h>
#include <sys/sendfile.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/sysmacros.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <sys/xattr.h>
#include <unistd.h>

#define DEVICE "/dev/i2c-7"
#define TARGET 0x1A
static void *volatile bad = (void *)8; /* an address without memory */

static void report(const char *name, long result)
{
    if (result < 0)
        printf("%s\t%s\n", name, strerrorname_np(errno));
    else
        printf("%s\t%ld\n", name, result);
    fflush(stdout);
}

/* A result that is "ok" unless it is an error. */
static void check(const char *name, long result)
{
    if (result < 0)
        report(name, result);
    else
        printf("%s\tok\n", name);
    fflush(stdout);
}

#define ROW(name, call) (errno = 0, report(name, (long)(call)))
#define OK(name, call) (errno = 0, check(name, (long)(call)))

static int wrong(void)
{
    errno = EPROTO;
    return -1;
}

static int transfer(int fd, struct i2c_msg *messages, unsigned count)
{
    struct i2c_rdwr_ioctl_data data = {messages, count};
    return ioctl(fd, I2C_RDWR, &data);
}

/* Reads register 0x41 by a combined transfer. */
static int ask(int fd)
{
    unsigned char pointer = 0x41, byte = 0;
    struct i2c_msg messages[2] = {{TARGET, 0, 1, &pointer}, {TARGET, I2C_M_RD, 1, &byte}};
    int result = transfer(fd, messages, 2);
    return result == 2 && byte != 0x41 ? wrong() : result;
}

static int smbus(int fd, int direction, int command, int size, union i2c_smbus_data *data)
{
    struct i2c_smbus_ioctl_data call = {(unsigned char)direction, (unsigned char)command, (unsigned)size, data};
    return ioctl(fd, I2C_SMBUS, &call);
}

static int opened(int flags)
{
    int fd = open(DEVICE, flags, 0600);
    if (fd >= 0 && !(flags & O_PATH)) ioctl(fd, I2C_SLAVE, TARGET);
    return fd;
}

/* Sets the pointer with write, and reads one byte with read. */
static int use(int fd, int reading)
{
    unsigned char byte = 0x41;
    int result = (int)write(fd, &byte, 1);
    if (!reading || result < 0) return result;
    byte = 0;
    result = (int)read(fd, &byte, 1);
    return result == 1 && byte != 0x41 ? wrong() : result;
}

static int is_device(const struct stat *found)
{
    int ours = S_ISCHR(found->st_mode) && found->st_rdev == makedev(89, 7);
    return ours ? 0 : wrong();
}

static void *work(void *fd)
{
    long good = 0;
    for (int i = 0; i < 200; i++) good += ask(*(int *)fd) == 2;
    return (void *)good;
}

static int threads(int fd)
{
    pthread_t thread[4];
    long good = 0;
    void *one;
    for (int i = 0; i < 4; i++) pthread_create(&thread[i], NULL, work, &fd);
    for (int i = 0; i < 4; i++) pthread_join(thread[i], &one), good += (long)one;
    return (int)good;
}

static int passed(int fd)
{
    int ends[2], got;
    char byte = 0, space[CMSG_SPACE(sizeof fd)];
    struct iovec part = {&byte, 1};
    struct msghdr message = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = space, .msg_controllen = sizeof space};
    socketpair(AF_UNIX, SOCK_DGRAM, 0, ends);
    struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    *head = (struct cmsghdr){CMSG_LEN(sizeof fd), SOL_SOCKET, SCM_RIGHTS};
    memcpy(CMSG_DATA(head), &fd, sizeof fd);
    sendmsg(ends[0], &message, 0);
    message.msg_controllen = sizeof space;
    recvmsg(ends[1], &message, 0);
    memcpy(&got, CMSG_DATA(CMSG_FIRSTHDR(&message)), sizeof got);
    return got;
}

static int in_child(int fd, const char *self)
{
    pid_t child = fork();
    int status;
    char number[16];
    snprintf(number, sizeof number, "%d", fd);
    if (!child && self) execl(self, self, "child", number, NULL);
    if (!child) _exit(ask(fd));
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : wrong();
}

static int listed(DIR *folder)
{
    int count = 0;
    for (struct dirent *one; (one = readdir(folder));)
        count += !strcmp(one->d_name, "i2c-7") && one->d_type == DT_CHR;
    return count;
}

static int is_ours(const struct dirent *one) { return !strcmp(one->d_name, "i2c-7"); }

static void paths(int fd, const char *folder)
{
    struct stat found;
    struct statx extended;
    char link[256], chain[256], text[64] = {0}, own[64];
    snprintf(link, sizeof link, "%s/bus", folder);
    snprintf(chain, sizeof chain, "%s/chain", folder);
    snprintf(own, sizeof own, "/proc/self/fd/%d", fd);
    if (symlink(DEVICE, link) || symlink("bus", chain)) perror("symlink");
    OK("open by a symbolic link", open(link, O_RDWR));
    OK("open by a link to a link", open(chain, O_RDWR));
    OK("open by a link, O_NOFOLLOW", open(link, O_RDWR | O_NOFOLLOW));
    OK("open of /proc/self/fd/N", ask(open(own, O_RDWR)));
    OK("stat: a character device 89:N", stat(DEVICE, &found) || stat(link, &found) ? -1 : is_device(&found));
    OK("lstat", lstat(DEVICE, &found) ? -1 : is_device(&found));
    OK("fstat", fstat(fd, &found) ? -1 : is_device(&found));
    OK("fstatat, empty path", fstatat(fd, "", &found, AT_EMPTY_PATH) ? -1 : is_device(&found));
    OK("statx", statx(AT_FDCWD, DEVICE, 0, STATX_BASIC_STATS, &extended)      ? -1
                : extended.stx_rdev_major == 89 && extended.stx_rdev_minor == 7 ? 0
                                                                                : wrong());
    ROW("access R_OK | W_OK", access(DEVICE, R_OK | W_OK));
    ROW("access X_OK", access(DEVICE, X_OK));
    ROW("access with unknown bits", access(DEVICE, 64));
    ROW("readlink", readlink(DEVICE, text, sizeof text));
    OK("readlink of /proc/self/fd/N", readlink(own, text, sizeof text) < 0 ? -1 : strcmp(text, DEVICE) ? wrong() : 0);
    char *real = realpath(link, NULL);
    OK("realpath", !real ? -1 : strcmp(real, DEVICE) ? wrong() : 0);
    ROW("getxattr", getxattr(DEVICE, "user.none", text, sizeof text));
    DIR *dev = opendir("/dev");
    ROW("readdir of /dev lists it", listed(dev));
    rewinddir(dev);
    ROW("readdir again after rewinddir", listed(dev));
    closedir(dev);
    glob_t matches;
    ROW("glob /dev/i2c-*", glob("/dev/i2c-*", 0, NULL, &matches) ? -1 : (long)matches.gl_pathc);
    struct dirent **all;
    ROW("scandir of /dev", scandir("/dev", &all, is_ours, alphasort));
}

static void opening(void)
{
    struct open_how how = {.flags = O_RDWR};
    OK("open of another bus", open("/dev/i2c-6", O_RDWR));
    OK("open O_RDWR", open(DEVICE, O_RDWR));
    OK("open O_CREAT", open(DEVICE, O_RDWR | O_CREAT, 0600));
    OK("open O_CREAT | O_EXCL", open(DEVICE, O_RDWR | O_CREAT | O_EXCL, 0600));
    OK("open O_DIRECTORY", open(DEVICE, O_RDONLY | O_DIRECTORY));
    OK("open O_DIRECT", open(DEVICE, O_RDWR | O_DIRECT));
    OK("open O_TRUNC", open(DEVICE, O_RDWR | O_TRUNC));
    OK("open O_PATH", open(DEVICE, O_PATH));
    OK("openat in /dev", openat(open("/dev", O_RDONLY | O_DIRECTORY), "i2c-7", O_RDWR));
    OK("openat2", syscall(SYS_openat2, AT_FDCWD, DEVICE, &how, sizeof how));
    OK("open with .. in the path", open("/dev/../dev/./i2c-7", O_RDWR));
    OK("open relative to the working folder", chdir("/dev") ? -1 : open("i2c-7", O_RDWR));
    int free_one = dup(1);
    close(free_one);
    OK("open takes the lowest free number", open(DEVICE, O_RDWR) == free_one ? 0 : wrong());
    int many = 0;
    for (int i = 0, fd = 0; i < 200 && fd >= 0; i++) many += (fd = open(DEVICE, O_RDWR)) >= 0;
    ROW("200 opened at once", many);
    struct rlimit limit = {40, 0}, old;
    getrlimit(RLIMIT_NOFILE, &old);
    limit.rlim_max = old.rlim_max;
    setrlimit(RLIMIT_NOFILE, &limit);
    OK("open above RLIMIT_NOFILE", open(DEVICE, O_RDWR));
    setrlimit(RLIMIT_NOFILE, &old);
    close_range(free_one, ~0U, 0);
}

static void copies(int fd, const char *self)
{
    int copy = dup(fd), gone = opened(O_RDWR);
    ROW("dup, then ioctl", ask(copy));
    ROW("dup, then write", use(copy, 0));
    ROW("dup2 to a low number, then write", use(dup2(fd, 20), 0));
    ROW("dup2 to a low number, then read", use(20, 1));
    int in = dup(0);
    ROW("dup2 to 0", dup2(fd, 0));
    dup2(in, 0);
    ROW("dup3 O_CLOEXEC, then F_GETFD", fcntl(dup3(fd, 21, O_CLOEXEC), F_GETFD));
    ROW("F_DUPFD to 200", fcntl(fd, F_DUPFD, 200));
    ROW("F_DUPFD_CLOEXEC, then F_GETFD", fcntl(fcntl(fd, F_DUPFD_CLOEXEC, 0), F_GETFD));
    ROW("open O_CLOEXEC, then F_GETFD", fcntl(open(DEVICE, O_RDWR | O_CLOEXEC), F_GETFD));
    close(gone);
    ROW("close, then ioctl", ask(gone));
    gone = opened(O_RDWR);
    close_range((unsigned)gone, (unsigned)gone, 0);
    ROW("close_range, then ioctl", ask(gone));
    int got = passed(fd);
    ROW("ioctl after SCM_RIGHTS", ask(got));
    ROW("write after SCM_RIGHTS", use(got, 0));
    ROW("read after SCM_RIGHTS", use(got, 1));
    ROW("ioctl in a forked child", in_child(fd, NULL));
    ROW("write and read after exec", in_child(fd, self));
    ROW("ioctl of four threads at once", threads(fd));
}

static void moves(int fd)
{
    unsigned char bytes[9000] = {0x41}, value[2] = {0x10, 0x11};
    struct iovec out[2] = {{bytes, 1}, {value, 2}}, in[2] = {{bytes, 3}, {bytes + 3, 5}};
    struct iovec *many = calloc(1025, sizeof *many);
    int pipe_ends[2], reader = opened(O_RDONLY), writer = opened(O_WRONLY), path = opened(O_PATH);
    int file = fileno(tmpfile());
    if (pipe(pipe_ends) || write(file, "x", 1) != 1 || lseek(file, 0, SEEK_SET)) perror("files");
    ROW("write, 1 byte", write(fd, bytes, 1));
    ROW("read, 1 byte", read(fd, bytes, 1));
    ROW("read, 0 bytes", read(fd, bytes, 0));
    ROW("write, 0 bytes", write(fd, bytes, 0));
    bytes[0] = 0x41;
    ROW("pwrite", pwrite(fd, bytes, 1, 1000));
    ROW("pread", pread(fd, bytes, 1, 1000) == 1 && bytes[0] == 0x41 ? 1 : -1);
    ROW("pread at a negative offset", pread(fd, bytes, 1, -1));
    ROW("writev of 1 + 2 bytes", writev(fd, out, 2));
    ROW("readv of 3 + 5 bytes", readv(fd, in, 2));
    ROW("readv of nothing", readv(fd, many, 3));
    ROW("readv of 1025 parts", readv(fd, many, 1025));
    bytes[0] = 0x41;
    ROW("pwritev", pwritev(fd, out, 1, 0));
    ROW("preadv", preadv(fd, &(struct iovec){bytes, 1}, 1, 0));
    ROW("preadv2 with RWF_NOWAIT", preadv2(fd, in, 1, 0, RWF_NOWAIT));
    ROW("read of a file opened O_WRONLY", read(writer, bytes, 1));
    ROW("write to a file opened O_RDONLY", write(reader, bytes, 1));
    ROW("read of a file opened O_PATH", read(path, bytes, 1));
    ROW("lseek", lseek(fd, 0, SEEK_CUR));
    ROW("sendfile from the file", sendfile(pipe_ends[1], fd, NULL, 1));
    ROW("sendfile to the file", sendfile(fd, file, NULL, 1));
    ROW("copy_file_range", copy_file_range(file, NULL, fd, NULL, 1, 0));
    ROW("splice", splice(fd, NULL, pipe_ends[1], NULL, 1, 0));
    ROW("read, 9000 bytes", read(fd, bytes, sizeof bytes));
    ROW("read before I2C_SLAVE", read(open(DEVICE, O_RDWR), bytes, 1));
    ROW("read to a bad pointer", read(fd, bad, 8));
    ROW("write from a bad pointer", write(fd, bad, 8));
    ROW("F_GETFL of O_RDWR", fcntl(fd, F_GETFL) & O_ACCMODE);
    ROW("F_GETFL of O_RDONLY", fcntl(reader, F_GETFL) & O_ACCMODE);
    ROW("F_GETFL of O_WRONLY", fcntl(writer, F_GETFL) & O_ACCMODE);
    ROW("F_SETFL O_NONBLOCK, then F_GETFL",
        fcntl(writer, F_SETFL, O_NONBLOCK) ? -1 : !!(fcntl(writer, F_GETFL) & O_NONBLOCK));
    ROW("I2C_RDWR, file opened O_RDONLY", ask(reader));
    ROW("I2C_RDWR, file opened O_PATH", ask(path));
    FILE *stream = fopen(DEVICE, "r+b");
    setvbuf(stream, NULL, _IONBF, 0);
    ioctl(fileno(stream), I2C_SLAVE, TARGET);
    ROW("fopen, fread of 1 byte", fread(bytes, 1, 1, stream));
    ROW("ioctl on fileno", ask(fileno(stream)));
    fclose(stream);
}

static void others(int fd)
{
    struct pollfd polled = {fd, POLLIN | POLLOUT, 0};
    struct epoll_event event = {EPOLLIN, {0}};
    struct timeval now = {0};
    fd_set set;
    int count = 0;
    char parameters[256] = {0}, terminal[64];
    FD_ZERO(&set);
    FD_SET(fd, &set);
    ROW("poll for both", poll(&polled, 1, 0) == 1 ? polled.revents : -1);
    ROW("select for reading", select(fd + 1, &set, NULL, NULL, &now));
    ROW("epoll_ctl ADD", epoll_ctl(epoll_create1(0), EPOLL_CTL_ADD, fd, &event));
    ROW("flock", flock(fd, LOCK_EX | LOCK_NB));
    ROW("fsync", fsync(fd));
    ROW("ftruncate", ftruncate(fd, 0));
    ROW("fallocate", fallocate(fd, 0, 0, 1));
    ROW("mmap", mmap(NULL, 4096, PROT_READ, MAP_SHARED, fd, 0) == MAP_FAILED ? -1 : 0);
    ROW("ioctl TCGETS", ioctl(fd, 0x5401, terminal));
    ROW("ioctl FIONREAD", ioctl(fd, 0x541B, &count));
    ROW("ioctl FIOASYNC", ioctl(fd, 0x5452, &(int){1}));
    ROW("ioctl FIONBIO", ioctl(fd, 0x5421, &count));
    OK("io_uring_setup", syscall(425, 1, parameters));
}

static void requests(int fd)
{
    static unsigned char bytes[9000];
    union i2c_smbus_data data = {0};
    unsigned long functions;
    struct i2c_msg many[43], absent = {0x33, I2C_M_RD, 1, bytes};
    for (int i = 0; i < 43; i++) many[i] = (struct i2c_msg){TARGET, I2C_M_RD, 1, bytes};
    ROW("I2C_SLAVE_FORCE", ioctl(fd, I2C_SLAVE_FORCE, TARGET));
    ROW("I2C_SLAVE_FORCE of 0x80", ioctl(fd, I2C_SLAVE_FORCE, 0x80));
    ROW("I2C_TENBIT, then I2C_SLAVE 0x3ff",
        ioctl(fd, I2C_TENBIT, 1) ? -1 : ioctl(fd, I2C_SLAVE, 0x3FF));
    ROW("I2C_SLAVE 0x400, 10-bit", ioctl(fd, I2C_SLAVE, 0x400));
    ROW("read from a 10-bit address", read(fd, bytes, 1));
    ioctl(fd, I2C_TENBIT, 0);
    ROW("I2C_SLAVE", ioctl(fd, I2C_SLAVE, TARGET));
    ROW("I2C_SLAVE of 0x80", ioctl(fd, I2C_SLAVE, 0x80));
    ROW("I2C_PEC", ioctl(fd, I2C_PEC, 0));
    ROW("I2C_RETRIES", ioctl(fd, I2C_RETRIES, 1));
    ROW("I2C_RETRIES above INT_MAX", ioctl(fd, I2C_RETRIES, 0x80000000UL));
    ROW("I2C_TIMEOUT", ioctl(fd, I2C_TIMEOUT, 100));
    ROW("I2C_TIMEOUT above INT_MAX", ioctl(fd, I2C_TIMEOUT, 0x80000000UL));
    ROW("I2C_FUNCS", ioctl(fd, I2C_FUNCS, &functions));
    ROW("I2C_FUNCS to a bad pointer", ioctl(fd, I2C_FUNCS, bad));
    ROW("I2C_RDWR from a bad pointer", ioctl(fd, I2C_RDWR, bad));
    ROW("I2C_RDWR with a bad buffer", transfer(fd, &(struct i2c_msg){TARGET, 0, 4, bad}, 1));
    ROW("I2C_RDWR without messages", transfer(fd, many, 0));
    ROW("I2C_RDWR, 42 messages", transfer(fd, many, 42));
    ROW("I2C_RDWR, 43 messages", transfer(fd, many, 43));
    ROW("I2C_RDWR, 8193 bytes", transfer(fd, &(struct i2c_msg){TARGET, I2C_M_RD, 8193, bytes}, 1));
    ROW("I2C_RDWR, address not acknowledged", transfer(fd, &absent, 1));
    many[0].flags |= I2C_M_NOSTART;
    ROW("I2C_RDWR with I2C_M_NOSTART", transfer(fd, many, 1));
    ROW("I2C_SMBUS, unknown size", smbus(fd, I2C_SMBUS_READ, 1, 99, &data));
    ROW("I2C_SMBUS, unknown direction", smbus(fd, 2, 1, I2C_SMBUS_BYTE_DATA, &data));
    ROW("I2C_SMBUS without data", smbus(fd, I2C_SMBUS_READ, 1, I2C_SMBUS_BYTE_DATA, NULL));
    ROW("I2C_SMBUS from a bad pointer", ioctl(fd, I2C_SMBUS, bad));
    ROW("I2C_SMBUS byte data", smbus(fd, I2C_SMBUS_READ, 0x41, I2C_SMBUS_BYTE_DATA, &data));
    data.block[0] = 33;
    ROW("I2C_SMBUS block of 33 bytes", smbus(fd, I2C_SMBUS_WRITE, 1, I2C_SMBUS_BLOCK_DATA, &data));
    ROW("unknown request 0x0799", ioctl(fd, 0x0799, 0));
}

int main(int count, char **arguments)
{
    signal(SIGPIPE, SIG_DFL);
    if (count == 3 && !strcmp(arguments[1], "child")) return use(atoi(arguments[2]), 1);
    if (count != 3) return 2; /* the program's own path, and an empty folder */
    opening();
    int fd = opened(O_RDWR);
    paths(fd, arguments[2]);
    copies(fd, arguments[1]);
    moves(fd);
    others(fd);
    requests(fd);
    return 0;
}
