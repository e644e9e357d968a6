// Loop of voting.py; shapes are those of the Python form.

#include <algorithm>
#include <cstdint>

extern "C" {

// Votes (centroids, stars), added to `votes`, of the pairs of stars as far apart as each pair of
// centroids. steps: of the binary searches. Returns the entries of the pair list looked up.
int64_t voting_vote(const float* rising, const uint16_t* firsts, const uint16_t* seconds,
                    int64_t entries, const float* angles, const int64_t* ones,
                    const int64_t* others, int64_t pairs, double margin_rad, int64_t stars,
                    int64_t* votes, int64_t* steps) {
    const float margin = float(margin_rad);
    int64_t looked_up = 0;
    *steps = 0;
    for (int64_t pair = 0; pair < pairs; pair++) {
        const float least = angles[pair] - margin, most = angles[pair] + margin;
        int64_t low = 0, high = entries;
        while (low < high) {
            const int64_t middle = (low + high) / 2;
            (rising[middle] < least ? low : high) = rising[middle] < least ? middle + 1 : middle;
            ++*steps;
        }
        const int64_t end = std::upper_bound(rising, rising + entries, most) - rising;
        int64_t* one = votes + ones[pair] * stars;
        int64_t* other = votes + others[pair] * stars;
        looked_up += std::max(end - low, int64_t(0));
        for (int64_t entry = low; entry < end; entry++) {
            const int64_t star = firsts[entry], partner = seconds[entry];
            one[star]++, one[partner]++, other[partner]++, other[star]++;
        }
    }
    return looked_up;
}

}
