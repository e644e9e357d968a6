// Loop of triples.py and triple_triangles.py: triangles of a database within bounds.

#include <cstdint>
#include <cstring>

namespace triples {

// The database lies anywhere in RAM, so its numbers need not be aligned.
template <typename Number>
int64_t number(const uint8_t* array, int64_t place) {
    Number value;
    std::memcpy(&value, array + place * sizeof value, sizeof value);
    return value;
}

}  // namespace triples

extern "C" {

// Of each of the `count` ranges of `moments` (triangles in the order of their moments, uint32),
// those from `firsts` to before `lasts`, and of `wanted` faces, unless `faces` (uint16) is null.
// kept: number of each range. Returns the number of all, -1 for a face beyond `face_count`.
int64_t triples_within(const uint8_t* moments, int64_t count, const int64_t* starts,
                       const int64_t* lengths, const int64_t* firsts, const int64_t* lasts,
                       const uint8_t* faces, const uint8_t* wanted, int64_t face_count,
                       uint32_t* found, int64_t* kept) {
    using namespace triples;
    int64_t total = 0;
    for (int64_t range = 0; range < count; range++) {
        const int64_t before = total, first = firsts[range], last = lasts[range];
        const uint8_t* from = moments + 4 * starts[range];
        for (int64_t n = 0; n < lengths[range]; n++) {
            const int64_t triangle = number<uint32_t>(from, n);
            found[total] = uint32_t(triangle);
            total += triangle >= first && triangle < last;
        }
        if (faces) {
            const int64_t end = total;
            total = before;
            for (int64_t n = before; n < end; n++) {
                const int64_t face = number<uint16_t>(faces, found[n]);
                if (face >= face_count) return -1;
                found[total] = found[n];
                total += wanted[face];
            }
        }
        kept[range] = total - before;
    }
    return total;
}

}
