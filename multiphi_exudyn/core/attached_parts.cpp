#include "attached_parts.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "law/impact.hpp"
#include "singular_values.hpp"
#include "symmetric_eigenpairs.hpp"

namespace multiphi {

namespace {

constexpr int scaled = 3;              // times that rows and columns are scaled to their largest entry (D. Ruiz 2001)
constexpr double round_off = 1e-15;    // of the largest eigenvalue or singular value: smaller ones count as zero
constexpr double negligible = 1e-10;   // of the largest mobility of a point or singular value: smaller ones are zero

struct PseudoInverse {
    Matrix inverse, range;
};

// Pseudo-inverse (k, k) of a symmetric matrix without negative eigenvalues, and its range, orthonormal.
PseudoInverse inverse_on_range(const Matrix& matrix, double smallest) {
    if (matrix.rows() == 0) return {Matrix(0, 0), Matrix(0, 0)};
    const Symmetric pairs = symmetric_eigenpairs(matrix);
    const Index n = pairs.values.size();
    const double largest = std::max(pairs.values.maxCoeff(), 0.0);
    Index zeros = 0;
    while (zeros < n && !(pairs.values[zeros] > smallest * largest)) ++zeros;
    const Matrix range = pairs.vectors.rightCols(n - zeros);
    return {range * pairs.values.tail(n - zeros).cwiseInverse().asDiagonal() * range.transpose(), range};
}

// Orthonormal basis (n, f) of the motions that constraints (k, n) allow.
Matrix null_space(const Matrix& jacobian) {
    if (!(jacobian.array() != 0.0).any()) return Matrix::Identity(jacobian.cols(), jacobian.cols());
    const SingularValues parts = singular_values(jacobian);
    const Index rank = (parts.values.array() > negligible * parts.values.maxCoeff()).count();
    return parts.right.rightCols(jacobian.cols() - rank);
}

// The points' coordinates and all that masses and constraints connect with them, ascending.
std::vector<int> connected_coordinates(const Matrix& mass, const Matrix& jacobian, const std::vector<int>& points) {
    const Index n = mass.rows();
    std::vector<char> is_connected(static_cast<std::size_t>(n), 0);
    std::vector<int> open(points);
    for (const int point : points) is_connected[point] = 1;
    const auto connect = [&](Index i) {
        if (is_connected[i]) return;
        is_connected[i] = 1;
        open.push_back(static_cast<int>(i));
    };
    while (!open.empty()) {
        const int here = open.back();
        open.pop_back();
        for (Index i = 0; i < n; ++i)
            if (mass(here, i) != 0.0) connect(i);
        for (Index k = 0; k < jacobian.rows(); ++k) {
            if (jacobian(k, here) == 0.0) continue;
            for (Index i = 0; i < n; ++i)
                if (jacobian(k, i) != 0.0) connect(i);
        }
    }
    std::vector<int> found;
    for (Index i = 0; i < n; ++i)
        if (is_connected[i]) found.push_back(static_cast<int>(i));
    return found;
}

}  // namespace

Vector solve_constrained(const Matrix& mass, const Matrix& jacobian, const Vector& forces, const Vector& prescribed) {
    const Index n = mass.rows(), k = jacobian.rows(), count = n + k;
    if (count == 0) return Vector(0);
    const bool is_diagonal = (mass.array() != 0.0).count() == n && (mass.diagonal().array() != 0.0).count() == n;
    if (k == 0 && is_diagonal) return forces.cwiseQuotient(mass.diagonal());
    Matrix system = Matrix::Zero(count, count);
    system.topLeftCorner(n, n) = mass;
    system.bottomLeftCorner(k, n) = jacobian;
    system.topRightCorner(n, k) = jacobian.transpose();
    Vector scale = Vector::Ones(count), right(count);
    for (int pass = 0; pass < scaled; ++pass) {
        Vector largest = (system.cwiseAbs() * scale.asDiagonal()).rowwise().maxCoeff().cwiseProduct(scale).cwiseSqrt();
        for (double& value : largest)
            if (value == 0.0) value = 1.0;
        scale = scale.cwiseQuotient(largest);
    }
    right << forces, prescribed;
    system = scale.asDiagonal() * system * scale.asDiagonal();
    return scale.cwiseProduct(solve_or_least(system, scale.cwiseProduct(right)));
}

AttachedParts::AttachedParts(Matrix system_mass, Matrix system_jacobian, int first, const Matrix& own_mass,
                             const std::vector<int>& points)
    : mass(std::move(system_mass)), jacobian(std::move(system_jacobian)) {
    const Index n = mass.rows(), m = static_cast<Index>(points.size()), size = own_mass.rows();
    bool is_attached = false;
    for (const int point : points)
        is_attached =
            is_attached || (mass.row(point).array() != 0.0).any() || (jacobian.col(point).array() != 0.0).any();
    const auto own_rows = mass.middleRows(first, size);
    const bool same = (own_rows.array() != 0.0).count() == (own_mass.array() != 0.0).count() &&
                      (own_rows.middleCols(first, size).array() == own_mass.array()).all();
    acts_on_body = !same || (jacobian.middleCols(first, size).array() != 0.0).any();
    only_forces = !is_attached && !acts_on_body;
    if (!is_attached) {
        inertia = Matrix::Zero(m, m);
        free = Matrix::Identity(m, m);
        follower = Matrix::Zero(n, m);
        return;
    }
    Matrix others = jacobian;
    others.middleCols(first, size).setZero();
    connected = connected_coordinates(mass, others, points);
    std::vector<int> rows, at;
    const Matrix all_rows = others(Eigen::all, connected);
    for (Index k = 0; k < others.rows(); ++k)
        if ((all_rows.row(k).array() != 0.0).any()) rows.push_back(static_cast<int>(k));
    for (const int point : points)
        at.push_back(static_cast<int>(std::lower_bound(connected.begin(), connected.end(), point) - connected.begin()));
    const Matrix moved_mass = mass(connected, connected), vectors = null_space(all_rows(rows, Eigen::all));
    const Matrix on_points = vectors(at, Eigen::all);  // y of the motions that constraints allow
    const double heaviest = moved_mass.diagonal().maxCoeff();
    const Matrix weighted = vectors.transpose() * moved_mass * vectors +
                            (heaviest != 0.0 ? heaviest : 1.0) * on_points.transpose() * on_points;
    const Matrix mobility = inverse_on_range(weighted, round_off).inverse;
    PseudoInverse of_points = inverse_on_range(on_points * mobility * on_points.transpose(), negligible);
    const Matrix motion = vectors * mobility * on_points.transpose() * of_points.inverse;
    follower = Matrix::Zero(n, m);
    follower(connected, Eigen::all) = motion;
    inertia = motion.transpose() * moved_mass * motion;
    free = std::move(of_points.range);
}

PointInertia::PointInertia(const Matrix& mass, Matrix free, Matrix in_base)
    : mass_(mass), free_(std::move(free)), in_base_(std::move(in_base)) {
    const Index m = free_.rows(), k = free_.cols();
    constrained_ = k == 0   ? Matrix::Identity(m, m)
                   : k == m ? Matrix(m, 0)
                            : Matrix(singular_values(free_).left.rightCols(m - k));
    base_impedance_ = impedance(in_base_);
}

Matrix PointInertia::impedance(const Matrix& rows) const {
    const Index m = free_.rows(), k = free_.cols();
    const Matrix mobility = rows * rows.transpose();
    const double size = mobility.norm();
    Matrix forces(m, m);
    forces << mass_ * free_, constrained_ / (size != 0.0 ? size : 1.0);
    Matrix velocities = mobility * forces;
    velocities.leftCols(k) += free_;
    const SingularValues parts = singular_values(velocities);
    const double largest = m > 0 ? parts.values.maxCoeff() : 0.0;
    const Index rank = (parts.values.array() > round_off * largest).count();  // constraints may act where no mode moves
    return forces * parts.right.leftCols(rank) * parts.values.head(rank).cwiseInverse().asDiagonal() *
           parts.left.leftCols(rank).transpose();
}

Matrix PointInertia::reactions(const Matrix& impulses) const { return -base_impedance_ * (in_base_ * impulses); }

Matrix PointInertia::responses(const Matrix& directions) const {
    return directions + in_base_.transpose() * reactions(directions);
}

Matrix PointInertia::mobility(const Matrix& rows) const {
    const Matrix x = impedance(rows);
    const Index r = rows.cols();
    if (r == 0) return Matrix(0, 0);
    const Symmetric pairs =
        symmetric_eigenpairs(Matrix::Identity(r, r) - rows.transpose() * (x + x.transpose()) * rows / 2.0);
    return pairs.vectors * pairs.values.cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

Matrix PointInertia::velocity_map(const Matrix& before, const Matrix& after, const Matrix& matrix) const {
    return matrix - after.transpose() * (impedance(after) * (after * matrix - before));
}

Vector PointInertia::joining(const Matrix& rows, const Vector& difference) const {
    return -rows.transpose() * (impedance(rows) * difference);
}

Matrix PointInertia::reduced(const Matrix& units, const std::vector<int>& rigid) const {
    Matrix result = Matrix::Zero(units.rows(), units.cols());
    if (rigid.empty()) return result;
    const Matrix directions = units(rigid, Eigen::all).transpose();
    const Matrix products = directions.transpose() * responses(directions);
    const Symmetric pairs = symmetric_eigenpairs((products + products.transpose()) / 2.0);
    const Matrix vectors = pairs.vectors * pairs.values.cwiseMax(0.0).cwiseSqrt().asDiagonal();
    const Index kept = std::min<Index>(vectors.cols(), units.cols());
    for (std::size_t i = 0; i < rigid.size(); ++i)
        for (Index j = 0; j < kept; ++j) result(rigid[i], j) = vectors(static_cast<Index>(i), vectors.cols() - 1 - j);
    return result;
}

std::vector<int> PointInertia::immovable(const Matrix& directions, const std::vector<int>& rigid) const {
    std::vector<int> found;
    if (rigid.empty()) return found;
    const Matrix columns = directions(rigid, Eigen::all).transpose();
    const Matrix responding = responses(columns);
    for (std::size_t i = 0; i < rigid.size(); ++i) {
        const auto column = columns.col(static_cast<Index>(i));
        if (column.dot(responding.col(static_cast<Index>(i))) <= impact::immovable * column.squaredNorm())
            found.push_back(rigid[i]);
    }
    return found;
}

}  // namespace multiphi
