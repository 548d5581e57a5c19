#include "complementarity.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "orthonormal.hpp"
#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr int sets = 20;            // tried for every row: far fewer are needed
constexpr double apart = 1e-9;      // of its terms: shift of a row, so that no two reach zero together
constexpr double verified = 1e-12;  // of the sum of |z|: largest difference of x and G^T z

// Sets rows of length one from the first numbers of given rows, and their lengths, 1 for a zero row.
void scale_rows(const Rows& given, int unknowns, Rows& units, std::vector<double>& lengths) {
    units.resize(given.count(), unknowns);
    lengths.resize(static_cast<std::size_t>(given.count()));
    for (int k = 0; k < given.count(); ++k) {
        const double length = norm(given[k], unknowns);
        lengths[k] = length == 0.0 ? 1.0 : length;
        for (int i = 0; i < unknowns; ++i) units[k][i] = given[k][i] / lengths[k];
    }
}

}  // namespace

void SmallProblem::pose(int count, int unknowns, int channels) {
    unknowns_ = unknowns;
    separate_ = false;
    rows.resize(count, unknowns + channels);
    const std::size_t size = static_cast<std::size_t>(count);
    values.assign(size, 0.0);
    sizes.assign(size, 0.0);
    lower.assign(size, 0.0);
    upper.assign(size, infinity);
    leaders.assign(size, no_leader);
    ratios.assign(size, 0.0);
}

int SmallProblem::add_row() {
    values.push_back(0.0);
    sizes.push_back(0.0);
    lower.push_back(0.0);
    upper.push_back(infinity);
    leaders.push_back(no_leader);
    ratios.push_back(0.0);
    if (separate_) pushing_rows.add();
    return rows.add();
}

void SmallProblem::separate_pushing_rows() {
    separate_ = true;
    pushing_rows = rows;
}

SmallProblem::Outcome SmallProblem::solve(Order order) {
    change.assign(static_cast<std::size_t>(unknowns_), 0.0);
    multipliers.assign(values.size(), 0.0);
    sides.resize(values.size());
    excluding.clear();
    if (count() == 1) return solve_single_row();
    const Order other = order == Order::in_turn ? Order::most_violated : Order::in_turn;
    Outcome outcome = attempt(order, 0.0);
    if (outcome != Outcome::solved) outcome = attempt(other, 0.0);
    return outcome != Outcome::undecided ? outcome : attempt(order, apart);
}

// Solves by driving violated rows. `shift` is of the terms, times k + 1, by which row k is moved until all rows are
// complementary: rows that reach zero at once could else change sides in an endless cycle.
SmallProblem::Outcome SmallProblem::attempt(Order order, double shift) {
    scale();
    shift_rows(shift);
    push_fixed();
    for (int step = 0; step < sets * (count() + 1); ++step) {
        update_violations();
        const int driven = most_violated_row(order);
        if (driven < 0 && shift == 0.0) return verify_solution();
        if (driven < 0) {
            shift_rows(-shift);
            solve_free_rows();
            shift = 0.0;
            continue;
        }
        const Outcome outcome = drive_row(driven);
        if (outcome != Outcome::solved) return outcome;
    }
    return Outcome::undecided;
}

void SmallProblem::shift_rows(double shift) {
    for (int k = 0; k < count(); ++k) offsets_[k] += (k + 1) * shift * terms_[k];
}

// A single row, without a leader: the z of zero w, or the bound before it.
SmallProblem::Outcome SmallProblem::solve_single_row() {
    const double* pushing = separate_ ? pushing_rows[0] : rows[0];
    const double value = values[0], low = lower[0], high = upper[0];
    const double square = scalar_product(rows[0], pushing, unknowns_);
    double z = std::min(std::max(0.0, low), high);
    Side between = Side::waiting;
    if (std::abs(value + square * z) > round_off::zero * sizes[0]) {
        if (square <= 0.0 && ((value < 0.0 && high == infinity) || (value > 0.0 && low == -infinity))) {
            excluding.push_back(0);
            return Outcome::excluded;
        }
        if (square < 0.0) return Outcome::undecided;
        const double away = value > 0.0 ? low : high;
        z = square > 0.0 ? std::min(std::max(-value / square, low), high) : away;
        between = Side::free;
    }
    sides[0] = z <= low ? Side::below : z >= high ? Side::above : between;
    multipliers[0] = z;
    for (int i = 0; i < unknowns_; ++i) change[i] = pushing[i] * z;
    return Outcome::solved;
}

// Moves the z of a row until the row is complementary.
SmallProblem::Outcome SmallProblem::drive_row(int driven) {
    double way = results_[driven] > 0.0 ? -1.0 : 1.0;
    choose_sides(driven);
    sides[driven] = Side::waiting;
    for (int step = 0; step < sets * (count() + 1); ++step) {
        const double progress = way * move_free(driven, way);
        moves_[driven] = way;
        const double violation = std::max(-way * results_[driven], 0.0);
        Change next = first_change(driven, progress > 0.0 ? violation / progress : infinity);
        if (progress == 0.0 && accept_dependent_row(driven, next.distance)) {
            way = -way;  // its share moves to the free rows
            move_free(driven, way);
            moves_[driven] = way;
            next = first_change(driven, infinity);
        }
        if (!(next.distance < infinity)) {
            list_excluding(driven);
            return Outcome::excluded;
        }
        move_rows(driven, next.distance);
        if (next.side != Side::free) {
            fix_row(next.row, next.side);
        } else {
            choose_sides(next.row);
            add_free_row(next.row);
        }
        if (next.row == driven) {
            solve_free_rows();
            return Outcome::solved;
        }
    }
    return Outcome::undecided;
}

// Lists the rows that exclude each other: the driven one, and the free ones that move with it without a bound.
void SmallProblem::list_excluding(int driven) {
    excluding.clear();
    for (int k = 0; k < count(); ++k) {
        const bool moves = sides[k] == Side::free && std::abs(moves_[k]) > round_off::independent;
        if (moves || k == driven) excluding.push_back(k);
    }
}

// Moves the driven row and the free ones, and updates x and w.
void SmallProblem::move_rows(int driven, double step) {
    add_multiple(change.data(), step, direction_.data(), unknowns_);
    for (int k = 0; k < count(); ++k) {
        if (k == driven || sides[k] == Side::free) shares_[k] += step * moves_[k];
    }
    update_tied_shares();
    update_violations();
}

// Sets z; undecided where a row is not complementary or x is not G^T z.
SmallProblem::Outcome SmallProblem::verify_solution() {
    const double reach = norm(change.data(), unknowns_);
    double total = 0.0, most = 0.0, violation = 0.0;
    std::vector<double>& missing = pushed_;
    std::copy(change.begin(), change.end(), missing.begin());
    for (int k = 0; k < count(); ++k) {
        const double share = std::max(std::min(shares_[k], bound(k, Side::above)), bound(k, Side::below));
        total += std::abs(share);
        most = std::max(most, terms_[k]);
        add_multiple(missing.data(), -share, push_units()[k], unknowns_);
        const double w = std::abs(results_[k]);
        if (sides[k] == Side::free) violation = std::max(violation, w - round_off::following * (terms_[k] + reach));
        multipliers[k] = share / push_lengths()[k];
    }
    const double small = verified * (total + reach);
    const bool is_pushed = norm(missing.data(), unknowns_) <= small + round_off::zero * most;
    return violation <= small && is_pushed ? Outcome::solved : Outcome::undecided;
}

void SmallProblem::free_balanced_rows() {
    if (count() == 1) return;
    const double reach = norm(change.data(), unknowns_);
    for (int k = count() - 1; k >= 0; --k) {
        const bool is_balanced = std::abs(results_[k]) <= round_off::following * (terms_[k] + reach);
        if (is_balanced && is_at_bound(sides[k]) && has_range(k) && is_independent(k)) add_free_row(k);
    }
}

// Scales the rows of A and G to length one, and all else accordingly; sets every z to zero or its nearest bound.
void SmallProblem::scale() {
    const std::size_t size = values.size();
    same_ = !separate_ && std::all_of(leaders.begin(), leaders.end(), [](int leader) { return leader < 0; });
    scale_rows(rows, unknowns_, units_, lengths_);
    if (!same_) scale_rows(separate_ ? pushing_rows : rows, unknowns_, push_units_, push_lengths_);
    for (std::vector<double>* each : {&offsets_, &terms_, &belows_, &aboves_, &ties_, &shares_, &slacks_, &results_,
                                      &violations_, &moves_, &components_, &targets_}) {
        each->resize(size);
    }
    for (std::vector<double>* each : {&direction_, &remainder_, &pushed_}) {
        each->resize(static_cast<std::size_t>(unknowns_));
    }
    q_.resize(count(), unknowns_);
    r_.resize(count(), count());
    s_.resize(count(), count());
    free_.clear();
    for (int k = 0; k < count(); ++k) {
        const double length = lengths_[k], pushing = push_lengths()[k];
        const double low = pushing * lower[k], high = pushing * upper[k];
        offsets_[k] = values[k] / length;
        terms_[k] = sizes[k] / length;
        slacks_[k] = round_off::zero;
        belows_[k] = low;
        aboves_[k] = high;
        if (leaders[k] >= 0) ties_[k] = ratios[k] * pushing / push_lengths()[leaders[k]];
        shares_[k] = std::min(std::max(0.0, low), high);
        sides[k] = low >= 0.0 ? Side::below : Side::waiting;
        if (high <= 0.0 && low < 0.0) sides[k] = Side::above;
    }
}

// Sets w and the violations of the sides of rows that are not free.
void SmallProblem::update_violations() {
    const double reach = norm(change.data(), unknowns_);
    for (int k = 0; k < count(); ++k) {
        const double* unit = units_[k];
        double w = offsets_[k];
        for (int i = 0; i < unknowns_; ++i) w += unit[i] * change[i];
        results_[k] = w;
        violations_[k] = 0.0;
        if (sides[k] == Side::free || !has_range(k)) continue;
        const double violation = sides[k] == Side::waiting ? std::abs(w) : outward(sides[k]) * w;
        if (!(violation <= slacks_[k] * (terms_[k] + reach))) violations_[k] = violation;
    }
}

// The first of the most violated rows, to round-off, or of all violated ones (in turn); -1 for none.
int SmallProblem::most_violated_row(Order order) const {
    double largest = 0.0;
    for (int k = 0; k < count(); ++k) largest = std::max(largest, violations_[k]);
    const double least = order == Order::in_turn ? 0.0 : (1.0 - round_off::alike) * largest;
    for (int k = 0; k < count(); ++k) {
        if (violations_[k] > 0.0 && violations_[k] >= least) return k;
    }
    return -1;
}

// Sets the sides of rows tied to a leader that leaves zero, by the sign of their w; zero w makes them free.
void SmallProblem::choose_sides(int leader) {
    const double reach = norm(change.data(), unknowns_);
    for (int k = 0; k < count(); ++k) {
        if (leaders[k] != leader || has_range(k)) continue;
        const double w = results_[k];
        sides[k] = w > 0.0 ? Side::below : Side::above;
        if (std::abs(w) <= slacks_[k] * (terms_[k] + reach) && is_independent(k)) add_free_row(k);
    }
}

// Returns the next change of a side: of the driven row at zero w, which is at `limit`, if no other one comes before. Of
// rows that reach zero together to round-off, as parallel ones do, the driven one changes, or else the first one.
SmallProblem::Change SmallProblem::first_change(int driven, double limit) const {
    Change next{driven, Side::free, limit};
    const double least = round_off::independent * norm(direction_.data(), unknowns_);
    for (int k = 0; k < count(); ++k) {
        const int leader = leaders[k];
        const bool is_led = leader >= 0 && (leader == driven || sides[leader] == Side::free);
        if (k == driven || sides[k] == Side::free) {
            for (const Side side : {Side::below, Side::above}) {
                double closing = outward(side) * moves_[k];
                if (is_led) closing -= ties_[k] * moves_[leader];
                const double room = std::max(outward(side) * (bound(k, side) - shares_[k]), 0.0);
                if (closing > 0.0 && room / closing < next.distance) next = {k, side, room / closing};
            }
        } else if (is_at_bound(sides[k]) && violations_[k] == 0.0 && (is_led || has_range(k))) {
            const double closing = outward(sides[k]) * scalar_product(units_[k], direction_.data(), unknowns_);
            const double room = std::max(-outward(sides[k]) * results_[k], 0.0);
            if (closing > least && room / closing < (1.0 - round_off::alike) * next.distance) {
                next = {k, Side::free, room / closing};
            }
        }
    }
    return next;
}

// Accepts a row that depends on the free ones if its violation is as small as its remainder allows. It is not accepted
// where it can take over the share of one of them in a step of comparable size.
bool SmallProblem::accept_dependent_row(int row, double step) {
    const double terms = terms_[row] + norm(change.data(), unknowns_);
    if (violations_[row] > round_off::following * terms) return false;
    double total = 0.0;
    for (int k = 0; k < count(); ++k) total += std::abs(shares_[k]);
    if (violations_[row] > 0.0 && step <= 2.0 * total) return false;
    slacks_[row] = round_off::following;
    violations_[row] = 0.0;
    return true;
}

// Whether the bounds of a row differ.
bool SmallProblem::has_range(int row) const { return bound(row, Side::below) < bound(row, Side::above); }

}  // namespace multiphi
