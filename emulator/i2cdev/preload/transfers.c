/* read, write and other calls on a descriptor. Part of shim.c. */

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

ssize_t __read_chk(int fd, void *buffer, size_t count, size_t size)
{
    if (count > size) abort();
    return read(fd, buffer, count);
}
