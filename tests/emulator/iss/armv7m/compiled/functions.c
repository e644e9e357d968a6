/* The functions of libm, in double and float. */
#include "report.h"
#include <math.h>

#define EACH(X) X(sin) X(cos) X(tan) X(atan) X(exp) X(sinh) X(tanh) X(cbrt) X(floor) X(ceil) X(rint) \
    X(round) X(trunc) X(expm1) X(erf)
#define POSITIVE(X) X(log) X(log10) X(log2) X(sqrt) X(log1p) X(lgamma)

int main(void) {
    for (int i = 0; i < 12; i++) {
        const double x = ((int32_t)draw() % 2000000) / 100000.0, p = fabs(x) + 0.001, u = x / 20.001;
        const float xf = (float)x, pf = (float)p, uf = (float)u;
#define ONE(name) note_double(name(x)), note_float(name##f(xf));
        EACH(ONE)
#define TWO(name) note_double(name(p)), note_float(name##f(pf));
        POSITIVE(TWO)
        note_double(asin(u)), note_double(acos(u)), note_float(asinf(uf)), note_float(acosf(uf));
        note_double(pow(p, u)), note_float(powf(pf, uf));
        note_double(atan2(x, p)), note_float(atan2f(xf, pf)), note_double(fmod(x, 0.7));
        note_double(hypot(x, p)), note_float(hypotf(xf, pf)), note_double(ldexp(x, i - 5));
        int exponent;
        note_double(frexp(x, &exponent)), note((uint32_t)exponent);
        double whole;
        note_double(modf(x, &whole)), note_double(whole), note_double(fma(x, p, u));
        note((uint32_t)lrint(x)), note_double(nextafter(x, p)), note_double(copysign(p, x));
        if (i < 4) printf("%.17g %.9g\n", sin(x) * exp(u), (double)(cosf(xf) + sqrtf(pf)));
    }
    note((uint32_t)isnan(sqrt(-1.0))), note((uint32_t)isinf(exp(1000.0)));
    return report("functions");
}
