// The small complementarity problem of contact and friction, by principal pivoting.
//
//     w = A x + b,   x = G^T z,   low <= z <= high:   z = low, w >= 0;  z = high, w <= 0;  between, w = 0
//
// A (k, r) are the directions of displacement, G (k, r) those of force: W = A G^T is symmetric where G is A (contact
// without friction), else not. The bounds of a row may be tied to another one, its leader n:
//
//     low - mu z_n <= z <= high + mu z_n                                          (Coulomb's cone in a plane)
//
// At every step all rows but those not yet handled are complementary. The most violated row is driven: its z moves
// until its w is zero or z reaches a bound. Meanwhile free rows, between their bounds, keep w = 0; a free row that
// reaches a bound is fixed there, and a fixed row whose w reaches zero becomes free. With W positive definite, or a
// P-matrix, every row is driven once and the solution is unique. A row that depends linearly on free ones takes over
// their shares until one of them reaches a bound; if none does, there is no solution (excluded). So an independent set
// of redundant rows stays free, and none has to be removed before.
//
// For the free rows C, x_0 the contribution of the rows at their bounds:
//
//     A_C x = -b_C,   x = x_0 + G_C^T z_C,   A_C^T = Q R,   S = Q^T G_C^T,   S z_C = R^-T (-b_C) - Q^T x_0
//
// Where G is A, S is R, and R is inverted, not its square. A row at a bound that is tied to a free row, its leader,
// moves with it: it belongs to the leader's column of G.
//
// A solution is verified: free rows have zero w but for round-off of their terms, and x = G^T z. b has to be finite: a
// fixed row whose w is NaN counts as not violated.
//
// Sources: R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch. 4 (the principal
// pivoting method of Dantzig and Cottle); for G = A it is the method of D. Goldfarb, A. Idnani, Math. Programming 27
// (1983).
#pragma once

#include <vector>

#include "rows.hpp"

namespace multiphi {

class SmallProblem {
  public:
    // Where a row is: at a bound; free between them, with zero w; waiting between them, not yet handled.
    enum class Side { below, free, above, waiting };

    // excluded: the rows of `excluding` contradict each other. undecided: round-off prevents convergence of the sides.
    enum class Outcome { solved, excluded, undecided };

    // Which of several violated rows is driven first.
    enum class Order { most_violated, in_turn };

    static constexpr int no_leader = -1;

    // The problem; its memory is kept from one to the next. `pose` sets the sizes and what stands in brackets.
    Rows rows;                   // A (k, r + channels): the law keeps what channels add beside the r unknowns
    Rows pushing_rows;           // G, after `separate_pushing_rows`
    std::vector<double> values;  // b (k,) [0]
    std::vector<double> sizes;   // of the terms of b (k,) [0]
    std::vector<double> lower;   // bounds of z (k,) [0]
    std::vector<double> upper;   // [infinity]
    std::vector<int> leaders;    // (k,) [no_leader]
    std::vector<double> ratios;  // mu to the leader (k,) [0]

    // The solution.
    std::vector<double> change;       // x (r,)
    std::vector<double> multipliers;  // z (k,)
    std::vector<Side> sides;          // (k,)
    std::vector<int> excluding;       // rows that exclude each other

    // Begins a problem of `count` rows with so many unknowns; the rows themselves have to be filled.
    void pose(int count, int unknowns, int channels = 0);

    // Appends a row of zeros, with what `pose` sets, and returns its number.
    int add_row();

    // Gives forces directions G of their own, at first those of displacement; without it G is A.
    void separate_pushing_rows();

    // Solves the problem. In another order of driving, and then with rows moved apart, it tries again.
    Outcome solve(Order order);

    // Makes rows of a solution free that are at a bound while w is zero to round-off, the last ones first: whether such
    // a row has come to its bound or to zero w is decided by round-off. Those that depend on free rows keep their side,
    // and so does a single row.
    void free_balanced_rows();

    int count() const { return static_cast<int>(values.size()); }
    int unknowns() const { return unknowns_; }

  private:
    // The next row that changes its side, how far the driven row moves until then, and to which side.
    struct Change {
        int row;
        Side side;
        double distance;
    };

    Outcome solve_single_row();
    Outcome attempt(Order order, double shift);
    Outcome drive_row(int driven);
    Outcome verify_solution();
    void shift_rows(double shift);

    // Sides: scaling, violations and changes (complementarity.cpp).
    void scale();
    void update_violations();
    int most_violated_row(Order order) const;
    void choose_sides(int leader);
    Change first_change(int driven, double limit) const;
    bool accept_dependent_row(int row, double step);
    void list_excluding(int driven);
    void move_rows(int driven, double step);

    // Which sign of w violates a side at a bound: there z can only move inwards.
    static double outward(Side side) { return side == Side::below ? -1.0 : 1.0; }
    static bool is_at_bound(Side side) { return side == Side::below || side == Side::above; }

    // Free rows: their shares, and how these move with another row (free_rows.cpp).
    int active_leader(int row) const;
    double bound(int row, Side side) const;
    bool has_range(int row) const;
    bool is_independent(int row);
    void add_free_row(int row);
    void fix_row(int row, Side side);
    void set_pushed(int row);
    void factor();
    void eliminate();
    double move_free(int row, double way);
    void project_out(double* vector) const;
    void project_out(double* vector, double* shares) const;
    void push_free(double* vector);
    void solve_free_rows();
    void update_tied_shares();
    void push_fixed();

    const Rows& push_units() const { return same_ ? units_ : push_units_; }
    const std::vector<double>& push_lengths() const { return same_ ? lengths_ : push_lengths_; }
    int free_count() const { return static_cast<int>(free_.size()); }

    int unknowns_ = 0;
    bool separate_ = false;  // G is not A
    bool same_ = true;       // G is A, and no row is tied: S is R

    // The problem with rows of length one.
    Rows units_, push_units_;                      // A, G (k, r)
    std::vector<double> lengths_, push_lengths_;   // of the given rows, 1 for a zero row
    std::vector<double> offsets_, terms_;          // b and the sizes of its terms
    std::vector<double> belows_, aboves_, ties_;   // bounds and mu
    std::vector<double> shares_;                   // z
    std::vector<double> slacks_;                   // of its terms: violation of a row that is round-off
    std::vector<double> results_;                  // w
    std::vector<double> violations_;               // of the sides of rows that are not free, zero where round-off

    // The free rows.
    std::vector<int> free_;            // in the order in which they became free
    Rows q_, r_, s_;                   // Q (f, r) with orthonormal rows, R and S (f, f)
    std::vector<double> components_;   // (f,) along Q, then shares
    std::vector<double> targets_;      // (f,) along Q: -R^-T b
    std::vector<double> moves_;        // of z (k,), as the driven row moves by one
    std::vector<double> direction_;    // of x (r,), the same
    std::vector<double> remainder_;    // of a row beside the free ones (r,)
    std::vector<double> pushed_;       // a column of G, with those of rows tied to it (r,)
};

}  // namespace multiphi
