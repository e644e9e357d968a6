/* Linear algebra in float and double, a Fourier transform, a filter in fixed point. */
#include "report.h"
#include <math.h>
#include <stdlib.h>

#define N 6
static double inverse(double m[N][N]) {
    double determinant = 1;
    for (int i = 0; i < N; i++) {
        int pivot = i;
        for (int k = i; k < N; k++) if (fabs(m[k][i]) > fabs(m[pivot][i])) pivot = k;
        for (int k = 0; k < N; k++) { const double t = m[i][k]; m[i][k] = m[pivot][k], m[pivot][k] = t; }
        determinant *= pivot == i ? m[i][i] : -m[i][i];
        for (int r = i + 1; r < N; r++) {
            const double factor = m[r][i] / m[i][i];
            for (int k = i; k < N; k++) m[r][k] -= factor * m[i][k];
        }
    }
    return determinant;
}
static void transform(float *re, float *im, int n) {
    for (int i = 1, j = 0; i < n; i++) {
        int bit = n >> 1;
        for (; j & bit; bit >>= 1) j ^= bit;
        j ^= bit;
        if (i < j) { float t = re[i]; re[i] = re[j], re[j] = t, t = im[i], im[i] = im[j], im[j] = t; }
    }
    for (int length = 2; length <= n; length *= 2)
        for (int i = 0; i < n; i += length)
            for (int k = 0; k < length / 2; k++) {
                const float angle = -6.2831853f * (float)k / (float)length, c = cosf(angle), s = sinf(angle);
                float *a = &re[i + k], *b = &im[i + k];
                const float x = a[length / 2] * c - b[length / 2] * s, y = a[length / 2] * s + b[length / 2] * c;
                a[length / 2] = *a - x, b[length / 2] = *b - y, *a += x, *b += y;
            }
}

int main(void) {
    static double m[N][N];
    static float f[4][4], g[4][4], re[32], im[32];
    for (int round = 0; round < 3; round++) {
        for (int i = 0; i < N * N; i++) m[i / N][i % N] = (double)(int32_t)draw() / (1 << 24);
        const double determinant = inverse(m);
        note_double(determinant), printf("%.12g\n", determinant);
        for (int i = 0; i < 16; i++) f[i / 4][i % 4] = (float)(int16_t)draw() / 256, g[i % 4][i / 4] = (float)(int8_t)draw();
        for (int i = 0; i < 4; i++)
            for (int j = 0; j < 4; j++) {
                float dot = 0;
                for (int k = 0; k < 4; k++) dot += f[i][k] * g[k][j];
                note_float(dot);
            }
        for (int i = 0; i < 32; i++) re[i] = (float)(int8_t)draw(), im[i] = 0;
        transform(re, im, 32);
        for (int i = 0; i < 32; i++) note_float(re[i]), note_float(im[i]);
    }
    int32_t state[2] = {0, 0};
    for (int i = 0; i < 400; i++) {
        const int32_t in = (int16_t)draw();
        const int32_t out = (int32_t)(((int64_t)in * 12345 + (int64_t)state[0] * 20000 - (int64_t)state[1] * 9000) >> 15);
        state[1] = state[0], state[0] = out;
        note((uint32_t)out);
    }
    return report("matrices");
}
