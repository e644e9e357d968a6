/* stat and its like, access and links. Part of shim.c. */

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
