// The free rows of a small complementarity problem, between their bounds: their shares z, and how these move with
// another row (the equations are in complementarity.hpp).
#include <algorithm>
#include <cmath>

#include "complementarity.hpp"
#include "orthonormal.hpp"
#include "round_off.hpp"

namespace multiphi {

// The leader to which a row at one of its bounds is tied.
int SmallProblem::active_leader(int row) const {
    return is_at_bound(sides[row]) ? leaders[row] : no_leader;
}

// The bound of a row on a side.
double SmallProblem::bound(int row, Side side) const {
    const double constant = side == Side::below ? belows_[row] : aboves_[row];
    if (leaders[row] < 0) return constant;
    const double tied = ties_[row] * shares_[leaders[row]];
    return side == Side::below ? constant - tied : constant + tied;
}

// Sets the column of G of a row, with those of rows tied to it.
void SmallProblem::set_pushed(int row) {
    std::copy_n(push_units()[row], unknowns_, pushed_.data());
    for (int k = 0; k < count(); ++k) {
        if (leaders[k] != row || active_leader(k) != row) continue;
        const double share = sides[k] == Side::below ? -ties_[k] : ties_[k];
        add_multiple(pushed_.data(), share, push_units()[k], unknowns_);
    }
}

void SmallProblem::add_free_row(int row) {
    free_.push_back(row);
    sides[row] = Side::free;
}

// Fixes a row at its bound; rows tied to a leader of zero share are fixed too.
void SmallProblem::fix_row(int row, Side side) {
    sides[row] = side;
    shares_[row] = bound(row, side);
    for (int k = 0; k < count(); ++k) {
        if (leaders[k] == row && shares_[row] == 0.0 && sides[k] == Side::free) {
            sides[k] = Side::below;
            shares_[k] = bound(k, Side::below);
        }
    }
    std::erase_if(free_, [this](int each) { return sides[each] != Side::free; });
}

// Whether a row is linearly independent of the free ones.
bool SmallProblem::is_independent(int row) {
    factor();
    std::copy_n(units_[row], unknowns_, remainder_.data());
    project_out(remainder_.data());
    return free_count() < unknowns_ && norm(remainder_.data(), unknowns_) > round_off::independent;
}

// Q with orthonormal rows, R above its diagonal, by Gram-Schmidt, each row twice; and S.
void SmallProblem::factor() {
    const int size = free_count();
    for (int a = 0; a < size; ++a) {
        double* row = q_[a];
        std::copy_n(units_[free_[a]], unknowns_, row);
        for (int b = 0; b < size; ++b) r_[b][a] = 0.0;
        for (int pass = 0; pass < 2; ++pass) {
            for (int b = 0; b < a; ++b) {
                const double share = scalar_product(q_[b], row, unknowns_);
                r_[b][a] += share;
                add_multiple(row, -share, q_[b], unknowns_);
            }
        }
        const double length = norm(row, unknowns_);
        r_[a][a] = length;
        for (int i = 0; i < unknowns_; ++i) row[i] /= length > 0.0 ? length : 1.0;
    }
    for (int a = 0; a < size; ++a) {
        if (!same_) set_pushed(free_[a]);
        for (int b = 0; b < size; ++b) {
            s_[b][a] = same_ ? r_[b][a] : scalar_product(q_[b], pushed_.data(), unknowns_);
        }
    }
}

// Solves S x = components in place, by Gaussian elimination with pivoting; S is overwritten.
void SmallProblem::eliminate() {
    const int size = free_count();
    std::vector<double>& x = components_;
    for (int a = 0; a < size; ++a) {
        int best = a;
        for (int b = a + 1; b < size; ++b) {
            if (std::abs(s_[b][a]) > std::abs(s_[best][a])) best = b;
        }
        if (best != a) {
            for (int c = a; c < size; ++c) std::swap(s_[a][c], s_[best][c]);
            std::swap(x[a], x[best]);
        }
        for (int b = a + 1; b < size; ++b) {
            if (s_[b][a] == 0.0) continue;
            const double share = s_[b][a] / s_[a][a];
            for (int c = a + 1; c < size; ++c) s_[b][c] -= share * s_[a][c];
            x[b] -= share * x[a];
        }
    }
    for (int a = size - 1; a >= 0; --a) {
        double total = x[a];
        for (int b = a + 1; b < size; ++b) total -= s_[a][b] * x[b];
        x[a] = s_[a][a] != 0.0 ? total / s_[a][a] : 0.0;
    }
}

// Sets the moves of free rows and the direction of x as a row moves by `way`, 1 or -1; returns the rate of its w. Both
// x and w stay constant where the row depends linearly on the free ones.
double SmallProblem::move_free(int row, double way) {
    const int size = free_count();
    factor();
    set_pushed(row);
    for (int i = 0; i < unknowns_; ++i) {
        remainder_[i] = units_[row][i];
        direction_[i] = way * pushed_[i];
    }
    for (int b = 0; b < size; ++b) components_[b] = 0.0;
    project_out(remainder_.data());
    project_out(direction_.data(), components_.data());
    eliminate();
    for (int b = 0; b < size; ++b) {
        components_[b] = -components_[b];
        moves_[free_[b]] = components_[b];
    }
    if (!same_ && size > 0) {
        for (int i = 0; i < unknowns_; ++i) direction_[i] = way * pushed_[i];
        push_free(direction_.data());
        project_out(direction_.data());
    }
    const bool is_dependent =
        size > 0 && (size >= unknowns_ || norm(remainder_.data(), unknowns_) <= round_off::independent);
    if (is_dependent) std::fill(direction_.begin(), direction_.end(), 0.0);
    return scalar_product(remainder_.data(), direction_.data(), unknowns_);
}

// Subtracts from a vector its parts along Q, twice, for the round-off of nearly parallel rows.
void SmallProblem::project_out(double* vector) const {
    for (int pass = 0; pass < 2; ++pass) {
        for (int b = 0; b < free_count(); ++b) {
            const double share = scalar_product(q_[b], vector, unknowns_);
            add_multiple(vector, -share, q_[b], unknowns_);
        }
    }
}

// The same, and adds these parts to `shares` (f,).
void SmallProblem::project_out(double* vector, double* shares) const {
    for (int pass = 0; pass < 2; ++pass) {
        for (int b = 0; b < free_count(); ++b) {
            const double share = scalar_product(q_[b], vector, unknowns_);
            shares[b] += share;
            add_multiple(vector, -share, q_[b], unknowns_);
        }
    }
}

// Adds G^T z of the free rows, z the components, to a vector.
void SmallProblem::push_free(double* vector) {
    for (int a = 0; a < free_count(); ++a) {
        set_pushed(free_[a]);
        add_multiple(vector, components_[a], pushed_.data(), unknowns_);
    }
}

// Solves for x and the shares z of the free rows, with the others at their bounds.
void SmallProblem::solve_free_rows() {
    const int size = free_count();
    factor();
    update_tied_shares();
    push_fixed();
    for (int a = 0; a < size; ++a) {
        double target = -offsets_[free_[a]];
        for (int b = 0; b < a; ++b) target -= r_[b][a] * components_[b];
        components_[a] = r_[a][a] != 0.0 ? target / r_[a][a] : 0.0;
    }
    for (int a = 0; a < size; ++a) {
        targets_[a] = components_[a];
        components_[a] -= scalar_product(q_[a], change.data(), unknowns_);
    }
    if (same_) {
        for (int a = 0; a < size; ++a) add_multiple(change.data(), components_[a], q_[a], unknowns_);
    }
    eliminate();
    if (!same_) {
        push_free(change.data());
        for (int a = 0; a < size; ++a) {
            const double difference = targets_[a] - scalar_product(q_[a], change.data(), unknowns_);
            add_multiple(change.data(), difference, q_[a], unknowns_);
        }
    }
    for (int a = 0; a < size; ++a) shares_[free_[a]] = components_[a];
    update_tied_shares();
}

// Sets the shares of tied rows from those of their leaders.
void SmallProblem::update_tied_shares() {
    for (int k = 0; k < count(); ++k) {
        if (active_leader(k) >= 0) shares_[k] = bound(k, sides[k]);
    }
}

// Sets x to x_0: G^T z of the rows that are not free; of rows tied to a free one the constant part.
void SmallProblem::push_fixed() {
    std::fill(change.begin(), change.end(), 0.0);
    for (int k = 0; k < count(); ++k) {
        if (sides[k] == Side::free) continue;
        const int leader = active_leader(k);
        double share = shares_[k];
        if (leader >= 0 && sides[leader] == Side::free) share = sides[k] == Side::below ? belows_[k] : aboves_[k];
        if (share != 0.0) add_multiple(change.data(), share, push_units()[k], unknowns_);
    }
}

}  // namespace multiphi
