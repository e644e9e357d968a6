/* Streams: the C library's own calls do not pass here, so they are given functions. Part of shim.c. */

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
