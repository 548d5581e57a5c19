#include "search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace multiphi {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Remainder of a block's intervals, relative to the typical size of the signals.
constexpr double resolution = 0.004;
// Blocks, less than a second, after which a search checks how many remain, and how many may: minutes.
constexpr long patience = 1000;
constexpr double most_blocks = 1e6;
// Sample distances that are searched also where drift exceeds all else: bounds from their end cost as much.
constexpr double skipped = 12.0;
// Of the time in which the fastest growing exponential grows e-fold: bounds hold for at most twice this.
constexpr double window = 1.0;
// Of sum |c_j|: a falling signal farther from zero at another's root has a later root. So has a nearer one that needs
// more than an instant, unless it is round-off.
constexpr double meeting = 1e-11;

Descent none() { return {}; }

Descent found(const Fall& fall) { return {Descent::Outcome::found, fall.signal, fall.time, {}}; }

}  // namespace

DescentSearch::DescentSearch(double refinement)
    : resolution_(resolution / (refinement * refinement * refinement * refinement)) {}

Descent DescentSearch::first(const Exponentials& exponentials, const SearchedSignals& signals, double from,
                             double horizon) {
    candidate_.evaluations = 0;
    const Descent descent = search(exponentials, signals, from, horizon);
    if (descent.outcome == Descent::Outcome::none || descent.outcome == Descent::Outcome::found) {
        evaluations_ += candidate_.evaluations;
    }
    return descent;
}

Descent DescentSearch::search(const Exponentials& exponentials, const SearchedSignals& signals, double from,
                              double horizon) {
    if (signals.count == 0) return none();
    const double longest = exponentials.growth > 0.0 ? window / exponentials.growth : infinity;
    double begin = from, previous_distance = 0.0;
    long blocks = 0;
    while (begin < horizon) {
        const double window_end = std::min(horizon, begin + longest);
        const double latest = 2 * window_end - begin;  // a block may end later than the window
        bounds_.set(exponentials, signals, begin, latest);
        if (exponentials.eternal && bounds_.below_constants(signals)) return none();
        if (!bounds_.finite(signals)) return {Descent::Outcome::not_finite, -1, 0.0, {}};
        double later = begin;
        if (!exponentials.pure) {
            later = bounds_.drift_above(exponentials, signals, begin, window_end);
            if (later >= horizon) return none();
        }
        if (begin == 0.0) {
            set_starts(exponentials, signals);
            if (window_end == horizon && stay_above(signals, horizon)) return none();
            if (signals.count > 1 && exponentials.pure) {
                const std::optional<Fall> fall = fall_near_start(exponentials, signals, latest);
                if (fall) return fall->time <= horizon ? found(*fall) : none();
            }
        }
        const double distance = bounds_.sample_distance(signals, window_end - begin, resolution_);
        if (later > begin + skipped * distance) {
            begin = later - distance;  // where no signal is zero
            continue;
        }
        const bool has_factors = distance == previous_distance;
        previous_distance = distance;
        ++blocks;
        if (blocks > patience && horizon - begin > most_blocks * intervals_of_block * distance) {
            return {Descent::Outcome::too_long, -1, 0.0, {distance, horizon - begin}};
        }
        const std::optional<Fall> fall =
            block_.first(exponentials, signals, bounds_, begin, distance, horizon, has_factors, candidate_);
        if (fall) return found(*fall);
        begin += intervals_of_block * distance;
    }
    return none();
}

// Sets s and s' of every signal at t = 0.
void DescentSearch::set_starts(const Exponentials& exponentials, const SearchedSignals& signals) {
    if (static_cast<int>(starts_.size()) < signals.count) starts_.resize(signals.count);
    for (int s = 0; s < signals.count; ++s) {
        const Complex* c = signals.row(s);
        double value = signals.constants[s], slope = 0.0;
        for (int j = 0; j < exponentials.size(); ++j) {
            if (exponentials.powers[j] == 0) {
                value += c[j].real();
                slope += real_product(c[j], exponentials.rates[j]);
            } else if (exponentials.powers[j] == 1) {
                slope += c[j].real() / exponentials.unit;
            }
        }
        starts_[s] = {value, slope};
    }
}

// Whether values and slopes at t = 0 prove that no signal falls in [0, horizon]. A signal that starts at zero or above
// rises while s' > max|s''| t; one that starts above zero is above s + s' t - max|s''| t^2 / 2, which is least at one
// of the ends.
bool DescentSearch::stay_above(const SearchedSignals& signals, double horizon) const {
    for (int s = 0; s < signals.count; ++s) {
        const double value = starts_[s].value, slope = starts_[s].slope, slope_change = bounds_[s].of[2] * horizon;
        const double lowest = std::min(value, value + (slope - slope_change / 2) * horizon);
        const bool touches = value >= -negligible_size(bounds_[s].of[0], signals.constants[s], signals.noises[s]);
        if (!(lowest > 0.0) && !(touches && slope > slope_change)) return false;
    }
    return true;
}

// The first descent near t = 0 that Taylor's theorem certifies, none if it does not: 2 s max|s''| < s'^2 (Kantorovich)
// gives a falling s one root before 2 s / |s'|; the others stay above zero. valid: until when the bounds hold, for ever
// where nothing grows. All powers are zero.
std::optional<Fall> DescentSearch::fall_near_start(const Exponentials& exponentials, const SearchedSignals& signals,
                                                   double valid) {
    for (int s = 0; s < signals.count; ++s) {
        const double value = starts_[s].value, slope = starts_[s].slope;
        if (!(value > 0.0 && slope < 0.0 && 2 * value * bounds_[s].of[2] < slope * slope)) continue;
        const double latest = -2 * value / slope;
        if ((latest <= valid || exponentials.eternal) && others_stay_above(s, signals.count, latest)) {
            candidate_.set_signal(exponentials, signals.row(s), signals.constants[s], signals.noises[s], bounds_[s],
                                  0.0);
            candidate_.sample_ends(0.0, latest);
            candidate_.find_descent(0.0, latest);
            return Fall{s, candidate_.root()};
        }
    }
    return std::nullopt;
}

// Whether values and slopes at t = 0 prove that no other signal falls before `latest`.
bool DescentSearch::others_stay_above(int falling, int count, double latest) const {
    for (int s = 0; s < count; ++s) {
        const bool stays_high = starts_[s].value > bounds_[s].of[1] * latest;
        const bool rises = starts_[s].slope > bounds_[s].of[2] * latest;
        if (s != falling && !stays_high && !rises) return false;
    }
    return true;
}

void simultaneous(const Exponentials& exponentials, const SearchedSignals& signals, int found, double time,
                  std::vector<char>& fallen, std::vector<Complex>& phi) {
    const int p = exponentials.size();
    fallen.resize(signals.count);
    if (static_cast<int>(phi.size()) < p) phi.resize(p);
    exponentials.evaluate(time, phi.data());
    const double soon = exponentials.fastest > 0.0 ? instant / exponentials.fastest : 0.0;
    for (int s = 0; s < signals.count; ++s) {
        const Complex* c = signals.row(s);
        double value = signals.constants[s], terms = std::abs(value), slope = 0.0, steepest = 0.0;
        for (int j = 0; j < p; ++j) {
            const Complex term = product(c[j], phi[j]);
            value += term.real();
            slope += real_product(term, exponentials.rates[j]);
            const double size = modulus(c[j]) * modulus(phi[j]);
            terms += size;
            steepest += size * modulus(exponentials.rates[j]);
            if (exponentials.powers[j] > 0) {
                const double power = exponentials.powers[j] / exponentials.unit;
                slope += power * real_product(c[j], phi[j - 1]);
                steepest += power * modulus(c[j]) * modulus(phi[j - 1]);
            }
        }
        const double allowed = std::max(round_off::zero * terms, -slope * soon);
        const bool falls =
            terms > 0.0 && slope < -round_off::zero * steepest && value <= std::min(meeting * terms, allowed);
        fallen[s] = s == found || falls;
    }
}

int first_sign(const Exponentials& exponentials, Complex* c, double* sizes, const round_off::Sum& constant, int since) {
    const int p = exponentials.size();
    for (int order = 0; order < bounded_derivatives; ++order) {
        double value = order == 0 ? constant.value : 0.0;
        double noise = order == 0 ? round_off::zero * constant.size : 0.0;
        for (int j = 0; j < p; ++j) {
            if (exponentials.powers[j] == 0) {
                value += c[j].real();
                noise += round_off::zero * sizes[j];
            }
        }
        if (order >= since && std::abs(value) > noise) return value > 0.0 ? 1 : -1;
        exponentials.differentiate(c, c);
        for (int j = 0; j < p; ++j) {
            const double size = sizes[j];
            sizes[j] = size * modulus(exponentials.rates[j]);
            if (exponentials.powers[j] > 0) sizes[j - 1] += exponentials.powers[j] / exponentials.unit * size;
        }
    }
    return 0;
}

}  // namespace multiphi
