// Products of vectors, and what a few directions leave of them.
//
//     v - sum_p (q_p . v) q_p,   q_p the orthonormal vectors of the space of the directions
//
// A vector is a pointer to its first number and its length m.
#pragma once

#include <vector>

#include "linear_algebra.hpp"
#include "rows.hpp"

namespace multiphi {

// The product of two vectors, in four independent sums, which a processor adds up together.
double scalar_product(const double* a, const double* b, int m);

// The length of a vector.
double norm(const double* vector, int m);

// The sum of the absolute terms of `scalar_product`, which bounds its round-off.
double absolute_product(const double* a, const double* b, int m);

// Adds a multiple of another vector to a vector.
void add_multiple(double* vector, double factor, const double* other, int m);

// Removes a direction of any length from `count` vectors that follow each other.
void remove_direction(const double* direction, double* vectors, int m, int count = 1);

// The largest element of |V V^T - I|, V (r, m) vectors that follow each other; NaN where one is not finite.
double largest_product_error(const double* vectors, int m, int r);

// Orthonormal vectors of the space that directions span, which are added one by one.
class OrthonormalBasis {
  public:
    // Empties the basis; vectors have the length m from now on.
    void clear(int m);

    // Adds a direction of this length; false where it depends on those before it, and then nothing is added. It is
    // orthogonalised twice, which leaves round-off only.
    bool add_direction(const double* direction, double length);

    // Whether the space holds a direction of this length. Its part in the space decides, before its remainder does.
    bool holds(const double* direction, double length);

    // Removes the part in the space from `count` vectors that follow each other.
    void remove_from(double* vectors, int count) const;

    int size() const { return size_; }
    const double* operator[](int p) const { return vectors_[p]; }

  private:
    // Orthogonalises a direction into the vector after the last one; returns whether it is independent.
    bool orthogonalise(const double* direction, double length);

    Rows vectors_;  // size_ of them, and memory for one more
    int m_ = 0;
    int size_ = 0;
};

// Fills the basis of the links `held`, of all links' directions (l, m) with their lengths (l,); false where the held
// ones are not independent.
bool span(const Eigen::Ref<const Matrix>& directions, const Eigen::Ref<const Vector>& lengths,
          const std::vector<int>& held, OrthonormalBasis& basis);

// Which links (l,) the held ones determine, whose `span` the basis is, and which no mode moves.
std::vector<bool> following(const Eigen::Ref<const Matrix>& directions, const Eigen::Ref<const Vector>& lengths,
                            OrthonormalBasis& basis);

// The part of vectors (k, m), one a row, that is orthogonal to directions (d, m).
Matrix without(const Eigen::Ref<const Matrix>& directions, const Eigen::Ref<const Matrix>& vectors);

}  // namespace multiphi
