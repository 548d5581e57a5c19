#include "excitation.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "exponentials.hpp"

namespace multiphi {

namespace {

// The smallest power of two above a value, 1 where it is zero or not finite.
double power_of_two_above(double value) {
    int exponent = 0;
    if (std::isfinite(value)) std::frexp(value, &exponent);
    return std::ldexp(1.0, exponent);
}

// exp(rate delay), 1 where the exponent is zero.
Complex carried_on(const Complex& rate, double delay) {
    if (rate * delay == 0.0) return 1.0;
    const double size = exponential(rate.real() * delay), angle = rate.imag() * delay;
    return Complex(size * std::cos(angle), size * std::sin(angle));
}

// Coefficients of the same polynomials for a later start, s -> s + delay, by repeated synthetic division. `count` of
// them, each a row; `channel` is the column.
void move_polynomial(ComplexMatrix& coefficients, Index count, Index channel, double delay) {
    for (Index lowest = 0; lowest + 1 < count; ++lowest)
        for (Index d = count - 2; d >= lowest; --d) coefficients(d, channel) += delay * coefficients(d + 1, channel);
}

// The piece of a time function that holds a time, -1 before its first and after its last one.
int piece_at(const TimeFunction& function, double time) {
    const std::vector<double>& breaks = function.breaks;
    const int piece = static_cast<int>(std::upper_bound(breaks.begin(), breaks.end(), time) - breaks.begin()) - 1;
    return piece < static_cast<int>(function.rates.size()) ? piece : -1;
}

}  // namespace

Intervals::Intervals(std::vector<TimeFunction> functions, double start, double until)
    : functions_(std::move(functions)) {
    starts_.push_back(start);
    double beyond = std::numeric_limits<double>::infinity();
    for (const TimeFunction& function : functions_) {
        for (const double time : function.breaks) {
            if (time > start && time < until) starts_.push_back(time);
            if (time > start && time >= until) beyond = std::min(beyond, time);
        }
    }
    std::sort(starts_.begin(), starts_.end());
    starts_.erase(std::unique(starts_.begin(), starts_.end()), starts_.end());
    ends_.assign(starts_.begin() + 1, starts_.end());
    ends_.push_back(beyond);
    list_carriers(start, until);
}

void Intervals::list_carriers(double start, double until) {
    std::map<std::pair<double, double>, int> powers;  // by the parts of the rate
    const auto add = [&](const Complex& rate, int count) {
        int& largest = powers[{rate.real(), rate.imag()}];
        largest = std::max(largest, count);
    };
    for (const TimeFunction& function : functions_) {
        const std::vector<double>& breaks = function.breaks;
        const auto begins = [&](double time) { return time <= start || time < until; };
        for (std::size_t piece = 0; piece < function.rates.size(); ++piece)
            if (begins(breaks[piece]) && breaks[piece + 1] > start)
                add(function.rates[piece], static_cast<int>(function.coefficients.cols()));
        if (breaks.empty() || breaks.front() > start || begins(breaks.back())) add(0.0, 1);  // zero outside its pieces
    }
    for (const auto& [parts, count] : powers) carriers_.push_back({Complex(parts.first, parts.second), count});
}

int Intervals::at(double time) const {
    const int interval = static_cast<int>(std::upper_bound(starts_.begin(), starts_.end(), time) - starts_.begin()) - 1;
    return std::max(interval, 0);
}

void Intervals::terms(int interval, std::vector<Term>& result) const {
    const double time = starts_[interval];
    const int q = static_cast<int>(functions_.size());
    const auto rate_of = [&](int k, int piece) { return piece < 0 ? Complex(0.0) : functions_[k].rates[piece]; };
    const auto count_of = [&](int k, int piece) { return piece < 0 ? Index(1) : functions_[k].coefficients.cols(); };
    std::size_t count = 0;
    for (int leader = 0; leader < q; ++leader) {  // the first channel with its rate
        const int own_piece = piece_at(functions_[leader], time);
        const Complex rate = rate_of(leader, own_piece);
        Index rows = count_of(leader, own_piece);
        bool is_first = true;
        for (int k = 0; k < q; ++k) {
            const int piece = piece_at(functions_[k], time);
            if (rate_of(k, piece) != rate) continue;
            if (k < leader) is_first = false;
            rows = std::max(rows, count_of(k, piece));
        }
        if (!is_first) continue;
        if (result.size() <= count) result.emplace_back();
        Term& term = result[count++];
        term.rate = rate;
        term.coefficients.setZero(rows, q);
        for (int k = leader; k < q; ++k) {
            const int piece = piece_at(functions_[k], time);
            if (piece < 0 || functions_[k].rates[piece] != rate) continue;
            const double delay = time - functions_[k].breaks[piece];
            const Complex factor = carried_on(rate, delay);
            const Index own = functions_[k].coefficients.cols();
            for (Index d = 0; d < own; ++d) term.coefficients(d, k) = functions_[k].coefficients(piece, d) * factor;
            move_polynomial(term.coefficients, own, k, delay);
        }
    }
    result.resize(count);
}

Inputs::Inputs(const Excitation& excitation) : excitation_(&excitation) {
    for (Vector* part : {&values_, &rates_, &accelerations_, &value_sizes_, &rate_sizes_, &acceleration_sizes_})
        part->setZero(count());
}

double Inputs::interval_end() const {
    return count() ? excitation_->intervals.end(interval_) : std::numeric_limits<double>::infinity();
}

void Inputs::set(int interval, double age, double time, double until) {
    interval_ = interval;
    age_ = age;
    horizon_ = 1.0;
    if (!count()) return;
    excitation_->intervals.terms(interval, terms_);
    translate(age, time, until);
}

void Inputs::advance(double delay, double time, double until) {
    age_ += delay;
    if (count()) translate(delay, time, until);
}

void Inputs::translate(double delay, double time, double until) {
    // Bases are shared among motions of about the same length, as their unit is a power of two.
    horizon_ = power_of_two_above(until > time ? until - time : until);
    for (Term& term : terms_) {
        const Complex factor = carried_on(term.rate, delay);
        for (Index d = 0; d < term.coefficients.rows(); ++d)
            for (int k = 0; k < count(); ++k) term.coefficients(d, k) *= factor;
        for (int k = 0; k < count(); ++k) move_polynomial(term.coefficients, term.coefficients.rows(), k, delay);
    }
    evaluate();
}

void Inputs::evaluate() {
    for (Vector* part : {&values_, &rates_, &accelerations_, &value_sizes_, &rate_sizes_, &acceleration_sizes_})
        part->setZero();
    for (const Term& term : terms_) {
        const ComplexMatrix& a = term.coefficients;
        for (int k = 0; k < count(); ++k) {
            Complex first = term.rate * a(0, k), second = term.rate * first;
            if (a.rows() > 1) {
                first += a(1, k);
                second += 2.0 * term.rate * a(1, k);
            }
            if (a.rows() > 2) second += 2.0 * a(2, k);
            values_[k] += a(0, k).real();
            rates_[k] += first.real();
            accelerations_[k] += second.real();
            value_sizes_[k] += modulus(a(0, k));
            rate_sizes_[k] += modulus(first);
            acceleration_sizes_[k] += modulus(second);
        }
    }
}

}  // namespace multiphi
