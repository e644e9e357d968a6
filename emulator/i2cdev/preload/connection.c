/* The emulation's socket: which descriptors are device files, and calls on the bus. Part of shim.c. */

static int inode_of(int fd, ino_t *inode, mode_t *mode)
{
    struct stat found;
    if (real_syscall(SYS_fstat, fd, &found)) return -1; /* old C libraries export no fstat */
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

/* Drops the rest of a reply. */
static int discard(int fd, size_t count)
{
    char words[256];
    while (count) {
        size_t part = count < sizeof words ? count : sizeof words;
        if (receive_all(fd, words, part)) return -1;
        count -= part;
    }
    return 0;
}

/* Begins a connection. A server that refuses it may have sent its answer already. */
static int greet(int fd)
{
    uint32_t version = SOCKET_VERSION;
    struct head head = {sizeof head - sizeof head.length + sizeof version, 0, CALL_HELLO};
    struct iovec parts[2] = {{&head, sizeof head}, {&version, sizeof version}};
    struct tail tail;
    send_all(fd, parts, 2);
    if (receive_all(fd, &tail, sizeof tail)) return -1;
    if (tail.result < 0) {
        errno = -tail.result;
        return -1;
    }
    return discard(fd, tail.length - sizeof tail.result);
}

static int connect_bus(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    strcpy(address.sun_path, config.socket);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0), failure = ENODEV;
    if (fd < 0) return -1;
    int refused;
    do refused = connect(fd, (struct sockaddr *)&address, sizeof address);
    while (refused && errno == EINTR);
    if (!refused) {
        if (!greet(fd)) return fd;
        failure = errno == EIO || errno == ECONNRESET ? ENODEV : errno;
    }
    close(fd);
    errno = failure;
    return -1;
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

/* As an adapter's driver in Linux, a call waits through signals and cancellation: a handler, a jump
   out of one or a cancelled thread would leave the lock held and the connection in mid-reply. Signals
   that end the program do so at once. */
struct shield {
    sigset_t signals;
    int cancellation;
};

static void raise_shield(struct shield *before)
{
    static const int fatal[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT};
    static const int faults[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGABRT};
    sigset_t blocked;
    sigfillset(&blocked);
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) sigdelset(&blocked, faults[i]);
    for (size_t i = 0; i < sizeof fatal / sizeof *fatal; i++) {
        struct sigaction action;
        if (!sigaction(fatal[i], NULL, &action) && action.sa_handler == SIG_DFL)
            sigdelset(&blocked, fatal[i]);
    }
    pthread_sigmask(SIG_BLOCK, &blocked, &before->signals);
    pthread_setcancelstate(PTHREAD_CANCEL_DISABLE, &before->cancellation);
}

static void lower_shield(const struct shield *before)
{
    int unused;
    pthread_setcancelstate(before->cancellation, &unused);
    pthread_sigmask(SIG_SETMASK, &before->signals, NULL);
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
    struct shield shield;
    raise_shield(&shield);
    pthread_mutex_lock(&lock);
    int fd = open_channel();
    bool done = fd >= 0 && !send_all(fd, parts, count) && !receive_all(fd, &tail, sizeof tail);
    size_t left = tail.length - sizeof tail.result;
    done = done && !(tail.result < 0 ? discard(fd, left) : receive_data(fd, &sink, left));
    int failure = errno;
    if (!done && fd >= 0) {
        close(fd); /* it may still carry data of this call */
        channel = -1;
        if (failure == EPIPE || failure == ECONNRESET) failure = EIO;
    }
    pthread_mutex_unlock(&lock);
    lower_shield(&shield);
    if (done && tail.result >= 0) return tail.result;
    errno = done ? -tail.result : failure;
    return -1;
}
