/* Calls under a timer of 1 kHz whose handler was installed without SA_RESTART.
   Prints how many of each ended with EINTR. */

#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#define CALLS 300
#define DEVICE "/dev/i2c-7"
#define FILE_ON_DISK "/proc/self/exe"

static int device, file, channel[2];
static struct stat status;
static char bytes[8];

static void handle(int number) { (void)number; }

static void set_timer(long period_us)
{
    struct itimerval timer = {{0, period_us}, {0, period_us}};
    setitimer(ITIMER_REAL, &timer, NULL);
}

static int messages(void)
{
    unsigned char at = 0x80;
    struct i2c_msg both[2] = {{0x1a, 0, 1, &at}, {0x1a, I2C_M_RD, 8, (unsigned char *)bytes}};
    struct i2c_rdwr_ioctl_data data = {both, 2};
    int done = ioctl(device, I2C_RDWR, &data);
    if (done >= 0 && (done != 2 || (unsigned char)bytes[7] != 0x87)) errno = EPROTO;
    return errno == EPROTO ? -1 : done;
}

static int shut(int fd) { return fd < 0 ? -1 : close(fd); }
static int close_stream(FILE *stream) { return stream ? fclose(stream) : -1; }
static int close_folder(DIR *folder) { return folder ? closedir(folder) : -1; }

static int send_file(void)
{
    lseek(file, 0, SEEK_SET);
    return (int)copy_file_range(file, NULL, device, NULL, 1, 0) < 0 && errno != EINTR ? 0 : -1;
}

#define COUNT(name, call)                                                                           \
    do {                                                                                            \
        int interrupted = 0, wrong = 0;                                                             \
        for (int i = 0; i < CALLS; i++) {                                                           \
            errno = 0;                                                                              \
            if ((call) >= 0) continue;                                                              \
            if (errno == EINTR) interrupted++;                                                      \
            else wrong++;                                                                           \
        }                                                                                           \
        printf("%s: %d interrupted, %d wrong\n", name, interrupted, wrong);                         \
    } while (0)

static void wait_for_byte(const char *name)
{
    int done = (int)read(channel[0], bytes, 1);
    printf("%s: %d %s\n", name, done, strerror(errno));
}

int main(void)
{
    struct sigaction action = {.sa_handler = handle};
    sigaction(SIGALRM, &action, NULL);
    device = open(DEVICE, O_RDWR);
    file = open(FILE_ON_DISK, O_RDONLY);
    ioctl(device, I2C_SLAVE, 0x1a);
    set_timer(1000);
    COUNT("ioctl", messages());
    COUNT("write", write(device, "\x80", 1) - 1);
    COUNT("read", read(device, bytes, 1) - 1);
    COUNT("pread", pread(device, bytes, 1, 0) - 1);
    COUNT("open the device", shut(open(DEVICE, O_RDWR)));
    COUNT("stat the device", stat(DEVICE, &status));
    COUNT("dup", shut(dup(device)));
    COUNT("copy to the device", send_file());
    COUNT("open a file", shut(open(FILE_ON_DISK, O_RDONLY)));
    COUNT("open a stream", close_stream(fopen(FILE_ON_DISK, "r")));
    COUNT("open a folder", close_folder(opendir("/dev")));
    COUNT("stat a file", stat(FILE_ON_DISK, &status));
    COUNT("access", access(FILE_ON_DISK, R_OK));
    COUNT("read a file", pread(file, bytes, 8, 0) - 8);
    set_timer(0);
    /* As on Linux, a signal ends what waits. */
    socketpair(AF_UNIX, SOCK_STREAM, 0, channel);
    set_timer(20000);
    wait_for_byte("read of an empty socket");
    pipe(channel);
    wait_for_byte("read of an empty pipe");
    return 0;
}
