/* Which paths lead to the device file. Part of shim.c. */

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
