// Round-off: which sums of floating-point numbers are zero, and which have a sign.
//
//     |sum a_j| <= zero * sum |a_j|   is round-off: the sum has no sign
//
// A sum is compared with the sizes of its own terms, so decisions do not depend on units. The thresholds are those of
// mathematics/round_off.py, where Python code finds them.
#pragma once

#include <cmath>

namespace multiphi::round_off {

inline constexpr double zero = 1e-13;              // of the sum of |terms|: a sum below it is round-off
inline constexpr double defective = 1e5;           // condition of eigenvectors, from which close ones form a cluster
inline constexpr double worst_condition = 1e7;     // of eigenvectors without clusters
inline constexpr double product = 1e-15;           // of two unit vectors: a smaller scalar product is round-off
inline constexpr double independent = 1e-10;       // of its length: a smaller remainder depends on other directions
inline constexpr double following = 10 * independent;  // of its terms: allowed violation of an inequality that depends on others
inline constexpr double alike = 1e-10;             // of the larger one: two violations or reserves that are equal
inline constexpr double slow = 0.1;                // of 1 / |lambda|: a shorter motion is given by a few powers of time
inline constexpr double balanced = 1e-9;           // of the sum of |forces|: a smaller resultant is round-off
inline constexpr double clear = 2 * zero;          // of a sum's terms: a larger sum is above zero for any order of addition

// The sign of a value, 0 if it is round-off of terms whose absolute values add up to `size`. NaN counts as negative.
inline int sign_of(double value, double size) {
    if (std::abs(value) <= zero * size) return 0;
    return value > 0.0 ? 1 : -1;
}

// A sum and the size of its terms, kept together: every term counts by itself, also where two of them cancel.
struct Sum {
    double value = 0.0;
    double size = 0.0;

    void add(double term) {
        value += term;
        size += std::abs(term);
    }
    void add_size(double further) { size += further; }
    int sign() const { return sign_of(value, size); }
};

}  // namespace multiphi::round_off
