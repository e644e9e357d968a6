/* Listing of /dev. Part of shim.c. */

static struct {
    DIR *folder;
    bool listed;
} folders[MAX_OPENED];

/* A folder that is /dev gets the device file as its last entry. */
static DIR *watch_folder(DIR *folder)
{
    struct stat found, dev;
    int saved = errno;
    if (config.on && folder && !real_syscall(SYS_fstat, dirfd(folder), &found) &&
        !real_syscall(SYS_newfstatat, AT_FDCWD, "/dev", &dev, 0) && found.st_ino == dev.st_ino &&
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
