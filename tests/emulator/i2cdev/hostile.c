/* Programs that a bus must survive: hostile MODE. Prints a line per result; a hang is killed.
 *
 * A read of SLOW bytes takes a fifth of a second on the wire; the target at 0x1A has 256 registers.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#define DEVICE "/dev/i2c-7"
enum { TARGET = 0x1A, SLOW = 20, PAGE = 4096, THREADS = 8 };

static int bus;
static sigjmp_buf back;
static volatile int handled;

static void report(const char *name, long result)
{
    if (result < 0)
        printf("%s\t%s\n", name, strerrorname_np(errno));
    else
        printf("%s\t%ld\n", name, result);
    fflush(stdout);
}

#define ROW(name, call) (errno = 0, report(name, (long)(call)))

static int transfer(struct i2c_msg *messages, unsigned count)
{
    struct i2c_rdwr_ioctl_data data = {messages, count};
    return ioctl(bus, I2C_RDWR, &data);
}

static int read_bytes(unsigned char *data, unsigned short count)
{
    struct i2c_msg message = {TARGET, I2C_M_RD, count, data};
    return transfer(&message, 1);
}

static int ask(void)
{
    unsigned char byte;
    return read_bytes(&byte, 1);
}

static void *ask_slowly(void *result)
{
    unsigned char data[SLOW];
    errno = 0;
    long got = read_bytes(data, SLOW);
    if (result) *(long *)result = got < 0 ? -errno : got;
    return NULL;
}

/* Milliseconds, in which a slow read has begun and not ended. */
static void wait_ms(int ms) { usleep(1000 * ms); }

static void pointers(void)
{
    unsigned char *pages = mmap(NULL, 2 * PAGE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    unsigned char *edge = pages + PAGE - 1; /* one byte, then no memory */
    mprotect(pages + PAGE, PAGE, PROT_NONE);
    unsigned char *fixed = mmap(NULL, PAGE, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    struct i2c_msg write = {TARGET, 0, 2, edge};
    struct i2c_smbus_ioctl_data smbus = {I2C_SMBUS_READ, 0, I2C_SMBUS_WORD_DATA, (void *)edge};
    struct i2c_rdwr_ioctl_data array = {(struct i2c_msg *)edge, 2};
    ROW("write beyond the end of memory", transfer(&write, 1));
    ROW("read beyond the end of memory", read_bytes(edge, 2));
    ROW("read into memory that can not be written", read_bytes(fixed, 2));
    ROW("messages beyond the end of memory", ioctl(bus, I2C_RDWR, &array));
    ROW("SMBus data beyond the end of memory", ioctl(bus, I2C_SMBUS, &smbus));
    ROW("argument beyond the end of memory", ioctl(bus, I2C_RDWR, edge));
    ROW("negative pointer", ioctl(bus, I2C_RDWR, (void *)-1L));
    ROW("a call afterwards", ask());
}

static void huge(void)
{
    static unsigned char data[65535];
    struct i2c_msg many[42];
    for (int i = 0; i < 42; i++) many[i] = (struct i2c_msg){TARGET, i & 1 ? I2C_M_RD : 0, 65535, data};
    ROW("I2C_RDWR of 65535 bytes", read_bytes(data, 65535));
    ROW("42 messages of 65535 bytes", transfer(many, 42));
    ROW("read of 65535 bytes", read(bus, data, 65535));
    ROW("a call afterwards", ask());
}

static void closing(void)
{
    pthread_t thread;
    long result = 0;
    pthread_create(&thread, NULL, ask_slowly, &result);
    wait_ms(60);
    ROW("close under a call", close(bus));
    pthread_join(thread, NULL);
    ROW("the call", result);
    ROW("open again", (bus = open(DEVICE, O_RDWR)) < 0 ? -1 : 0);
    ROW("a call afterwards", ask());
    pthread_create(&thread, NULL, ask_slowly, &result);
    wait_ms(60);
    for (int fd = 3; fd < 1024; fd++) close(fd);
    pthread_join(thread, NULL);
    bus = open(DEVICE, O_RDWR);
    ROW("a call after all descriptors were closed under one", ask());
}

static void on_alarm(int number)
{
    (void)number;
    handled = ask();
}

static void jump(int number)
{
    (void)number;
    siglongjmp(back, 1);
}

static void on_signal(void (*handler)(int), int ms)
{
    struct itimerval timer = {.it_value = {0, 1000 * ms}};
    struct sigaction action = {.sa_handler = handler, .sa_flags = SA_RESTART};
    sigaction(SIGALRM, &action, NULL);
    setitimer(ITIMER_REAL, &timer, NULL);
}

static void signals(void)
{
    unsigned char data[SLOW];
    on_signal(on_alarm, 60);
    ROW("call under a signal", read_bytes(data, SLOW));
    ROW("call in its handler", handled);
    on_signal(jump, 60);
    if (!sigsetjmp(back, 1)) read_bytes(data, SLOW);
    ROW("a call after a jump out of a handler", ask());
}

static void cancelling(void)
{
    pthread_t thread;
    pthread_create(&thread, NULL, ask_slowly, NULL);
    wait_ms(60);
    pthread_cancel(thread);
    pthread_join(thread, NULL);
    ROW("a call after a thread was cancelled in one", ask());
}

static void killing(void)
{
    pid_t child = fork();
    int status;
    if (!child) {
        ask_slowly(NULL);
        _exit(0);
    }
    wait_ms(60);
    kill(child, SIGKILL);
    waitpid(child, &status, 0);
    ROW("signal that ended a program in a call", WTERMSIG(status));
    ROW("a call afterwards", ask());
    pthread_t threads[THREADS];
    long results[THREADS], good = 0;
    for (int i = 0; i < THREADS; i++) pthread_create(&threads[i], NULL, ask_slowly, &results[i]);
    child = fork(); /* while other threads are in calls */
    if (!child) _exit(ask() == 1 ? 0 : 1);
    waitpid(child, &status, 0);
    ROW("exit status of a child born under calls", WEXITSTATUS(status));
    for (int i = 0; i < THREADS; i++) {
        pthread_join(threads[i], NULL);
        good += results[i];
    }
    ROW("calls of other threads", good);
}

/* The emulation is our parent. */
static void orphaned(void)
{
    pthread_t thread;
    long result = 0;
    pthread_create(&thread, NULL, ask_slowly, &result);
    wait_ms(60);
    kill(getppid(), SIGKILL);
    pthread_join(thread, NULL);
    errno = result < 0 ? (int)-result : 0;
    report("a call whose emulation is killed", result < 0 ? -1 : result);
    ROW("a call afterwards", ask());
}

int main(int count, char **words)
{
    static const struct {
        const char *name;
        void (*run)(void);
    } modes[] = {{"pointers", pointers}, {"huge", huge}, {"closing", closing}, {"signals", signals},
                 {"cancelling", cancelling}, {"killing", killing}, {"orphaned", orphaned}};
    bus = open(DEVICE, O_RDWR);
    if (bus < 0 || count != 2 || ioctl(bus, I2C_SLAVE, TARGET)) return 2;
    for (size_t i = 0; i < sizeof modes / sizeof *modes; i++)
        if (!strcmp(words[1], modes[i].name)) modes[i].run();
    return 0;
}
