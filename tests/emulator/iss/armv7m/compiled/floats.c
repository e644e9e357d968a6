/* Soft float: operations and comparisons on any bits, and conversions. */
#include "report.h"

static double any_double(void) {
    uint64_t bits = (uint64_t)draw() << 32 | draw();
    double value;
    if (!(draw() & 3)) bits = (bits & 0x800FFFFFFFFFFFFFull) | (uint64_t)(1023 + draw() % 8) << 52;
    if (!(draw() & 15)) bits &= 0x800000000000FFFFull;
    memcpy(&value, &bits, 8);
    return value;
}
static float any_float(void) {
    uint32_t bits = draw();
    float value;
    if (!(draw() & 3)) bits = (bits & 0x807FFFFF) | (127 + draw() % 8) << 23;
    if (!(draw() & 15)) bits |= 0x7F800000;
    memcpy(&value, &bits, 4);
    return value;
}

int main(void) {
    for (int i = 0; i < 400; i++) {
        const double a = any_double(), b = any_double();
        const float c = any_float(), d = any_float();
        note_double(a + b), note_double(a - b), note_double(a * b), note_double(a / b);
        note_float(c + d), note_float(c - d), note_float(c * d), note_float(c / d);
        note((uint32_t)((a < b) | (a <= b) << 1 | (a > b) << 2 | (a >= b) << 3 | (a == b) << 4 | (a != b) << 5));
        note((uint32_t)((c < d) | (c <= d) << 1 | (c > d) << 2 | (c >= d) << 3 | (c == d) << 4 | (c != d) << 5));
        note_double((double)c), note_float((float)a);
        const int32_t whole = (int32_t)draw();
        note_double(whole), note_float((float)whole), note_double((uint32_t)whole), note_float((float)(uint32_t)whole);
        const int64_t wide = (int64_t)((uint64_t)draw() << 32 | draw());
        note_double((double)wide), note_float((float)wide), note_double((double)(uint64_t)wide);
        if (c > -2e9f && c < 2e9f) note((uint32_t)(int32_t)c);
        if (a > -9e18 && a < 9e18) note_64((uint64_t)(int64_t)a);
        if (a >= 0 && a < 4e9) note((uint32_t)a);
    }
    return report("floats");
}
