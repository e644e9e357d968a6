/* Opening the device file, and its ioctl requests. Part of shim.c. */

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
    if (send_all(fd, parts, 2) || receive_all(fd, &tail, sizeof tail) || tail.result < 0) {
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
