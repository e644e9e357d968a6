/* printf, scanf and their conversions. */
#include "report.h"
#include <stdlib.h>

int main(void) {
    static const double values[] = {0, 1, -1.5, 3.14159265358979, 1e-10, 6.02e23, 1e300, 0.1, 123456.789};
    char text[160];
    for (unsigned i = 0; i < sizeof values / sizeof *values; i++) {
        snprintf(text, sizeof text, "%f|%.3e|%g|%10.4f|%-12.2f|%a", values[i], values[i], values[i],
                 i > 5 ? 1.25 : values[i], i > 5 ? -2.5 : values[i], values[i]);
        puts(text);
        printf("%d\n", values[i] == strtod(text, NULL));
    }
    for (int i = 0; i < 12; i++) {
        const uint32_t a = draw();
        const uint64_t b = (uint64_t)draw() << 32 | draw();
        printf("%ld %lu %08lx %#o %+d %5d|%-8x|%llu %lld\n", (long)(int32_t)a, (unsigned long)a, (unsigned long)a,
               (unsigned)(a >> 20), (int)(a >> 16), (int)(a & 0xFFF), (unsigned)(a & 0xFFFF), b, (int64_t)b);
        snprintf(text, sizeof text, "%lu %x", (unsigned long)a, (unsigned)(a >> 8));
        unsigned long first;
        unsigned second;
        printf("%d %d\n", sscanf(text, "%lu %x", &first, &second), first == a && second == a >> 8);
    }
    printf("%s %.3s %c %% %5s|%-5s| %*d %p\n", "text", "abcdef", 'x', "ab", "cd", 7, 42, (void *)0x1234);
    printf("%ld %lu %ld\n", strtol("-0x7f", NULL, 0), strtoul("4294967295", NULL, 10), strtol("0777", NULL, 0));
    note((uint32_t)atoi("-12345"));
    return report("formats");
}
