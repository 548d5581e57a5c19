// Closed directions: the springs and rigid constraints that closed contacts make, one for each direction.
//
// Closed springs of one direction p, the chain of a force law or compliant contacts at one place, are one spring
//
//     f = -(K q + G),   q = p.y
//
// beside a closed rigid contact of that direction they are a constant force. What gaps add (G) is asked apart: the
// directions and stiffnesses of a level do not depend on gaps.
#pragma once

#include <vector>

#include "base.hpp"
#include "linear_algebra.hpp"

namespace multiphi {

class ClosedDirections {
  public:
    // closed: numbers of links.
    ClosedDirections(const Base& base, std::vector<int> closed);

    int count() const { return static_cast<int>(stiffness_.size()); }
    const std::vector<int>& closed() const { return closed_; }
    const std::vector<std::vector<int>>& members() const { return members_; }  // the links of each direction
    // p (d, m). Those of two or more rigid contacts are orthogonal, Q in P = R^T Q, of the largest of their lengths: the
    // small difference of nearly parallel directions would be lost in round-off.
    const Matrix& vectors() const { return vectors_; }
    const Vector& stiffness() const { return stiffness_; }                     // K (d,), infinite where rigid
    bool is_rigid(int direction) const;
    const std::vector<int>& rigid() const { return rigid_; }                   // rigid directions
    Matrix pinned() const { return vectors_(rigid_, Eigen::all); }
    // Those with a stiffness that is not zero, and the largest of their lengths.
    const std::vector<int>& resisting() const { return resisting_; }
    double size() const;

    // Along the vectors (d,) from gaps (k,) of the closed links at y = 0: G / K [m], G [N] where K is zero.
    Vector offsets(const Base& base, const Vector& gaps) const;
    // G (d,) [N], zero where rigid.
    Vector constants(const Vector& offsets) const;
    // Forces lambda (k,) [N] of the closed links from forces (d,) along the vectors and from all gaps (l,). The forces
    // of springs of one direction follow from their gaps; a rigid contact among them has the remainder.
    Vector contact_forces(const Base& base, const Vector& along, const Vector& gaps) const;

  private:
    void merge(const Base& base);
    void orthogonalise();

    std::vector<int> closed_;
    std::vector<std::vector<int>> members_;
    Matrix vectors_;
    Vector stiffness_;
    std::vector<int> rigid_, resisting_;
    Matrix triangle_;  // R of the rigid directions, empty where there are less than two
};

}  // namespace multiphi
