// A candidate interval: a signal may have a root there. It is divided until that is decided.
//
//     s(t) = constant + Re sum_j c_j phi_j(t),   max|s^(k)| <= bound_k, k = 0 ... 6
//
// Where certified monotony or curvature decides, the division ends; an inverse Taylor series gives the root. A
// polynomial lies above the smallest of its Bernstein coefficients; the signal differs from its interpolant by at most
// the remainders of signal_bounds.hpp. Source: G. Farin, Curves and Surfaces for CAGD, ch. 5.
#pragma once

#include <array>
#include <vector>

#include "exponentials.hpp"
#include "signal_bounds.hpp"

namespace multiphi {

class CandidateInterval {
  public:
    // Takes over a signal whose coefficients c (p,) hold from `origin` on; times of the interval count from there.
    // The exponentials and the bound have to live on.
    void set_signal(const Exponentials& exponentials, const Complex* c, double constant, double noise,
                    const SignalBound& bound, double origin);

    // Sets the signal and its derivatives at the ends of the interval, from times, or from exponentials there.
    void sample_ends(double left, double right);
    void combine_ends(const Complex* phi_left, const Complex* phi_right);

    // Whether the signal falls through zero in [left, right]; if so, root() says when. The ends have been set.
    bool has_descent(double left, double right);

    // Finds the root of a signal that falls through zero once in [left, right]. The ends have been set.
    void find_descent(double left, double right) { find_root(0, left, right, right_); }

    double root() const { return root_; }

    long evaluations = 0;  // of the exponentials

  private:
    static constexpr int sampled = 5;             // the signal and its derivatives up to the fourth
    static constexpr int deepest = 64;            // divisions: the narrowest interval is reached after 44
    using Derivatives = std::array<double, sampled>;  // s, s', ..., s^(4) at one time

    enum class Decision { undecided, no_descent, descent };

    // An interval that is decided after the ones before it.
    struct LaterInterval {
        double right;
        Derivatives at_right;
    };

    void sample_at(double u, Derivatives& result);
    void combine(const Complex* phi, Derivatives& result) const;
    Decision decide(double left, double right, double narrowest);
    Decision decide_convex(double left, double right);
    double lowest_value(double sign, double width) const;
    double lowest_derivative(int order, double sign, double width) const;
    bool rises(double width) const;
    void find_root(int order, double left, double right, const Derivatives& at_right);

    const Exponentials* exponentials_ = nullptr;
    const SignalBound* bound_ = nullptr;
    double constant_ = 0.0, origin_ = 0.0, root_ = 0.0;
    std::array<double, 3> noise_ = {};     // round-off of s, s', s''
    std::vector<Complex> coefficients_;    // (5, p): of s and its derivatives
    std::vector<Complex> phi_;             // (p,)
    Derivatives left_ = {}, right_ = {};   // at the ends of the interval
    std::array<LaterInterval, deepest> later_;
};

}  // namespace multiphi
