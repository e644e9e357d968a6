// Loop of confirmation.py; shapes and units are those of the Python form.

#include <cmath>
#include <cstdint>
#include <vector>

extern "C" {

// Measured (n, 3) and predicted (m, 3) vectors that are nearest to each other: rows of both and
// distances, at most the smaller of n and m. near: pairs whose first components are close.
int64_t stars_matched(const float* measured, int64_t n, const float* predicted, int64_t m,
                      double radius2, int64_t* rows, int64_t* stars, float* distances,
                      int64_t* near) {
    const float reach = float(radius2);
    std::vector<float> chords(n * m);
    std::vector<int64_t> inside;
    std::vector<uint8_t> of_row(n), of_star(m);
    bool twice = false;
    *near = 0;
    for (int64_t star = 0; star < m; star++)
        for (int64_t row = 0; row < n; row++) {
            const float* there = predicted + 3 * star;
            const float* here = measured + 3 * row;
            const float x = there[0] - here[0], y = there[1] - here[1], z = there[2] - here[2];
            const float x2 = x * x, chord = x2 + y * y + z * z;
            *near += x2 <= reach;
            chords[star * n + row] = chord;
            if (!(chord <= reach)) continue;
            inside.push_back(star * n + row);
            twice |= of_row[row] || of_star[star];
            of_row[row] = of_star[star] = 1;
        }
    int64_t found = 0;
    for (const int64_t place : inside) {
        const int64_t star = place / n, row = place % n;
        bool nearest = true;
        for (int64_t one = 0; twice && one < n; one++) {
            const float chord = chords[star * n + one];
            nearest &= one < row ? chord > chords[place] : chord >= chords[place];
        }
        for (int64_t one = 0; twice && one < m; one++) {
            const float chord = chords[one * n + row];
            nearest &= one < star ? chord > chords[place] : chord >= chords[place];
        }
        if (!nearest) continue;
        rows[found] = row;
        stars[found] = star;
        distances[found] = std::sqrt(chords[place]);
        found++;
    }
    return found;
}

}
