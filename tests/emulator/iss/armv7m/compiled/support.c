/* Start-up, system calls and output of the compiled test programs. What they print is kept in RAM;
   a program ends at `finished`. */

#include <stdint.h>
#include <string.h>
#include <sys/stat.h>

extern uint32_t data_source[], data_start[], data_end[], bss_start[], bss_end[], heap_start[];
extern uint32_t stack_top[];
int main(void);

char output[24576];
uint32_t output_length;
int exit_code = -1;

__attribute__((noreturn, naked)) void finished(void) { __asm volatile("b ."); }

void start(void) {
    memcpy(data_start, data_source, (size_t)((char *)data_end - (char *)data_start));
    memset(bss_start, 0, (size_t)((char *)bss_end - (char *)bss_start));
    exit_code = main();
    finished();
}

void fault(void) { finished(); }

__attribute__((section(".vectors"), used)) const void *const vectors[16] = {
    stack_top, start, fault, fault, fault, fault, fault};

int _write(int file, const char *text, int length) {
    (void)file;
    for (int i = 0; i < length && output_length < sizeof output; i++)
        output[output_length++] = text[i];
    return length;
}

void *_sbrk(int change) {
    static char *end;
    if (!end) end = (char *)heap_start;
    char *old = end;
    end += change;
    return old;
}

int _fstat(int file, struct stat *status) { (void)file; status->st_mode = S_IFCHR; return 0; }
int _read(int file, char *text, int length) { (void)file, (void)text, (void)length; return 0; }
int _lseek(int file, int offset, int from) { (void)file, (void)offset, (void)from; return 0; }
int _close(int file) { (void)file; return -1; }
int _isatty(int file) { (void)file; return 0; }
int _kill(int process, int signal) { (void)process, (void)signal; return -1; }
int _getpid(void) { return 1; }
void _exit(int code) { exit_code = code; finished(); }
