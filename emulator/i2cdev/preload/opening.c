/* open and its like, and ioctl. Part of shim.c. */

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
