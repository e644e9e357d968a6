/* A program that knows Linux's i2c-dev and nothing else. Its exit status is 17 when all is well. */

#include <errno.h>
#include <fcntl.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/wait.h>
#include <unistd.h>

#define CHECK(what)                                                                                \
    do {                                                                                           \
        if (!(what)) {                                                                             \
            fprintf(stderr, "line %d: %s (errno %d)\n", __LINE__, #what, errno);                   \
            exit(1);                                                                               \
        }                                                                                          \
    } while (0)
#define FAILS(what, code) CHECK((errno = 0, (what) == -1) && errno == (code))

int main(int count, char **arguments)
{
    unsigned char id = 0x92, data[9000];
    if (count == 2) { /* started by ourselves, with the device file open */
        CHECK(read(atoi(arguments[1]), data, 3) == 3);
        return data[1];
    }
    int fd = open("/dev/i2c-7", O_RDWR);
    CHECK(fd >= 0);
    struct stat found;
    CHECK(fstat(fd, &found) == 0 && S_ISCHR(found.st_mode) && major(found.st_rdev) == 89);
    FAILS(lseek(fd, 0, SEEK_SET), ESPIPE);
    unsigned long functions = 0;
    CHECK(ioctl(fd, I2C_FUNCS, &functions) == 0 && functions & I2C_FUNC_I2C);
    FAILS(ioctl(fd, I2C_FUNCS, (void *)8), EFAULT);

    FAILS(ioctl(fd, I2C_SLAVE, 0x80), EINVAL);
    CHECK(ioctl(fd, I2C_TENBIT, 1) == 0 && ioctl(fd, I2C_SLAVE, 0x3ff) == 0);
    FAILS(ioctl(fd, I2C_SLAVE, 0x400), EINVAL);
    FAILS(read(fd, data, 1), EOPNOTSUPP);
    CHECK(ioctl(fd, I2C_TENBIT, 0) == 0 && ioctl(fd, I2C_PEC, 0) == 0);
    CHECK(ioctl(fd, I2C_TIMEOUT, 10) == 0 && ioctl(fd, I2C_RETRIES, 3) == 0);
    CHECK(ioctl(fd, I2C_SLAVE_FORCE, 0x30) == 0);
    FAILS(write(fd, &id, 1), ENXIO);
    FAILS(read(fd, data, 1), ENXIO);
    CHECK(ioctl(fd, I2C_SLAVE, 0x1a) == 0);

    unsigned char command[] = {0x15, 0x50, 0x51};
    CHECK(write(fd, command, 3) == 3);
    for (data[0] = 0; !data[0];) {
        id = 0x83;
        CHECK(write(fd, &id, 1) == 1 && read(fd, data, 1) == 1);
    }
    id = 0x92;
    CHECK(write(fd, &id, 1) == 1 && read(fd, data, 5) == 5);
    CHECK(!memcmp(data, "\x00\x50\x51\xff\xff", 5));
    CHECK(read(fd, data, sizeof data) == 8192); /* cut, as the driver does */

    memset(data, 0, sizeof data);
    struct i2c_msg messages[43] = {{0x1a, 0, 1, &id}, {0x1a, I2C_M_RD, 3, data}};
    struct i2c_rdwr_ioctl_data transfer = {messages, 2};
    CHECK(ioctl(fd, I2C_RDWR, &transfer) == 2 && !memcmp(data, "\x00\x50\x51\x00", 4));
    transfer.nmsgs = 0;
    FAILS(ioctl(fd, I2C_RDWR, &transfer), EINVAL);
    transfer.nmsgs = 43;
    FAILS(ioctl(fd, I2C_RDWR, &transfer), EINVAL);
    transfer = (struct i2c_rdwr_ioctl_data){0, 1};
    FAILS(ioctl(fd, I2C_RDWR, &transfer), EINVAL);
    transfer = (struct i2c_rdwr_ioctl_data){messages, 2};
    messages[1].len = 8193;
    FAILS(ioctl(fd, I2C_RDWR, &transfer), EINVAL);
    messages[1] = (struct i2c_msg){0x1a, I2C_M_RD | I2C_M_NOSTART, 3, data};
    FAILS(ioctl(fd, I2C_RDWR, &transfer), EOPNOTSUPP);

    union i2c_smbus_data block = {.block = {3}};
    struct i2c_smbus_ioctl_data smbus = {I2C_SMBUS_READ, 0x92, I2C_SMBUS_I2C_BLOCK_DATA, &block};
    CHECK(ioctl(fd, I2C_SMBUS, &smbus) == 0 && !memcmp(block.block, "\x03\x00\x50\x51", 4));
    block.block[0] = 33;
    FAILS(ioctl(fd, I2C_SMBUS, &smbus), EINVAL);
    smbus.data = NULL;
    FAILS(ioctl(fd, I2C_SMBUS, &smbus), EINVAL);
    smbus = (struct i2c_smbus_ioctl_data){I2C_SMBUS_READ, 0x92, 99, &block};
    FAILS(ioctl(fd, I2C_SMBUS, &smbus), EINVAL);
    struct { /* nothing beyond the word may be touched */
        unsigned short word, guard;
    } word = {0, 0xabcd};
    smbus = (struct i2c_smbus_ioctl_data){I2C_SMBUS_READ, 0x92, I2C_SMBUS_WORD_DATA, (void *)&word};
    CHECK(ioctl(fd, I2C_SMBUS, &smbus) == 0 && word.word == 0x5000 && word.guard == 0xabcd);
    FAILS(ioctl(fd, 0x0709, 0), ENOTTY);

    int copy = dup(fd); /* shares the address */
    CHECK(copy >= 0 && close(fd) == 0 && write(copy, &id, 1) == 1);
    pid_t child = fork();
    if (!child) {
        char number[16];
        snprintf(number, sizeof number, "%d", copy);
        execl(arguments[0], arguments[0], number, NULL);
        _exit(99);
    }
    int status;
    CHECK(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0x50);
    CHECK(close(copy) == 0);
    FAILS(ioctl(copy, I2C_SLAVE, 0x1a), EBADF);
    FAILS(open("/dev/i2c-99", O_RDWR), ENOENT);
    for (int i = 0; i < 300; i++) { /* closed ones are given back */
        CHECK((fd = open("/dev/i2c-7", O_RDWR | O_CLOEXEC)) >= 0);
        CHECK(close(fd) == 0);
    }
    puts("all as on Linux");
    return 17;
}
