/* Blocks of memory and strings, at every alignment. */
#include "report.h"
#include <ctype.h>
#include <stdlib.h>

static uint8_t from[300], to[300];

int main(void) {
    for (int round = 0; round < 2; round++)
        for (unsigned a = 0; a < 5; a++)
            for (unsigned b = 0; b < 5; b++)
                for (unsigned n = 0; n < 70; n += 1 + n / 9) {
                    for (unsigned i = 0; i < 160; i++) from[i] = (uint8_t)(draw() | 1), to[i] = (uint8_t)i;
                    memcpy(to + a, from + b, n);
                    note(to[a]), note(to[a + n]), note((uint32_t)memcmp(to + a, from + b, n + 1) >> 31);
                    memmove(from + a, from + b, n), memmove(to + b, to + a, n);
                    memset(to + 80 + a, (int)n, n);
                    for (unsigned i = 0; i < 160; i++) note(to[i] << 8 | from[i]);
                }
    static char text[200], other[200];
    for (unsigned a = 0; a < 6; a++)
        for (unsigned n = 0; n < 30; n++) {
            for (unsigned i = 0; i < n; i++) text[a + i] = (char)('A' + (i * 7 + n) % 26);
            text[a + n] = 0;
            strcpy(other + (a ^ 3), text + a), strcat(other + (a ^ 3), "tail");
            note(strlen(text + a)), note((uint32_t)strcmp(text + a, other + (a ^ 3)) >> 31);
            note((uint32_t)strncmp(text + a, other + (a ^ 3), n) == 0);
            const char *found = strchr(text + a, 'K'), *last = strrchr(text + a, 'K');
            note(found ? (uint32_t)(found - text) : 99), note(last ? (uint32_t)(last - text) : 99);
            note(strstr(other, "tail") ? (uint32_t)(strstr(other, "tail") - other) : 77);
            note(strspn(text + a, "ABCDEFGHIJ")), note(strcspn(text + a, "XYZ"));
            strncpy(other, text + a, 20), note((uint32_t)memchr(other, 'Q', 20) != 0);
            for (char *p = text + a; *p; p++) note((uint32_t)(tolower((unsigned char)*p) ^ isalpha((unsigned char)*p)));
        }
    char words[] = "one, two;three  four";
    for (char *word = strtok(words, " ,;"); word; word = strtok(NULL, " ,;")) puts(word);
    return report("blocks");
}
