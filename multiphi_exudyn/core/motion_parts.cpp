#include "motion_parts.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "decompositions.hpp"
#include "failure.hpp"
#include "round_off.hpp"

namespace multiphi {

namespace {

constexpr double largest_step = 1e-3;  // of an eigenvector: a larger step of its refinement is not round-off
// largest distances in a cluster, of the rates, in the order of trials
constexpr double distances[] = {1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4};
constexpr int beyond = 8;  // powers of a cluster beyond its size, as its rates do not coincide exactly

// The places of rates above the real axis and on it.
std::vector<int> upper(const ComplexVector& rates) {
    std::vector<int> places;
    for (int j = 0; j < rates.size(); ++j) {
        if (rates[j].imag() >= 0.0) places.push_back(j);
    }
    return places;
}

// lambda and V of some of the pairs after a Newton step for all: V (I + F), F_ij = E_ij / (lambda_j - lambda_i).
//
// E = V^-1 (S V - V Lambda). An eigenvalue solver has an error of round-off of the largest rate in every pair; after
// the step it is round-off of the pair's own rate. Pairs too close for a step are not changed.
Eigenpairs refined(const Matrix& system, const Eigenpairs& pairs, const std::vector<int>& places) {
    Eigenpairs result{pairs.rates(places), pairs.vectors(Eigen::all, places)};
    ComplexMatrix errors = -(result.vectors * result.rates.asDiagonal());
    errors.real() += system * result.vectors.real();
    errors.imag() += system * result.vectors.imag();
    const ComplexMatrix residual = solve(pairs.vectors, errors);
    ComplexMatrix steps = ComplexMatrix::Zero(residual.rows(), residual.cols());
    for (Index i = 0; i < residual.rows(); ++i) {
        for (Index j = 0; j < residual.cols(); ++j) {
            const Complex difference = result.rates[j] - pairs.rates[i];
            const bool is_near = std::abs(residual(i, j)) >= largest_step * std::abs(difference);
            if (!is_near) steps(i, j) = residual(i, j) / difference;
        }
    }
    const ComplexMatrix corrections = pairs.vectors * steps;
    for (Index j = 0; j < residual.cols(); ++j) {
        const bool is_real = result.rates[j].imag() == 0.0;
        const Complex change = residual(places[j], j);
        result.rates[j] += is_real ? change.real() : change;
        for (Index i = 0; i < residual.rows(); ++i) {
            result.vectors(i, j) += is_real ? corrections(i, j).real() : corrections(i, j);
        }
    }
    return result;
}

// The real parts of vectors (s, k), then the imaginary parts of those with rates beside the real axis (s, s).
Matrix real_vectors(const ComplexMatrix& vectors, const ComplexVector& rates) {
    Matrix result(vectors.rows(), vectors.rows());
    Index last = vectors.cols();
    for (Index j = 0; j < vectors.cols(); ++j) {
        result.col(j) = vectors.col(j).real();
        if (rates[j].imag() != 0.0) result.col(last++) = vectors.col(j).imag();
    }
    return result;
}

// The condition of a matrix of eigenvectors, or a bound of it that is good: that of a real one, as a pair is a rotation
// of its parts times 2^(1/2).
double condition_of(const Eigenpairs& pairs) {
    const std::vector<int> places = upper(pairs.rates);
    const ComplexVector rates = pairs.rates(places);
    Matrix system = real_vectors(pairs.vectors(Eigen::all, places), rates);
    for (Index j = 0; j < rates.size(); ++j) {
        if (rates[j].imag() != 0.0) system.col(j) *= std::sqrt(2.0);
    }
    system.rightCols(system.cols() - rates.size()) *= std::sqrt(2.0);
    const double bound = system.norm() * inverse(system).norm();  // not smaller, and much cheaper
    return bound < round_off::defective ? bound : condition(system);
}

// c (k, s) of z = Re sum_j v_j c_j from the k vectors (s, k), real where their rates are.
//
// It is solved as a real system and refined once: an inverse of the complex vectors would give an error of their
// condition squared in z, this one of their condition.
ComplexMatrix real_part_inverse(const ComplexMatrix& vectors, const ComplexVector& rates) {
    const Matrix system = real_vectors(vectors, rates), first = inverse(system);
    const Matrix rest = Matrix::Identity(system.rows(), system.cols()) - system * first;
    const Matrix result = first + first * rest;
    ComplexMatrix coefficients = result.topRows(vectors.cols()).cast<Complex>();
    Index last = vectors.cols();
    for (Index j = 0; j < vectors.cols(); ++j) {
        if (rates[j].imag() != 0.0) coefficients.row(j).imag() = -result.row(last++);
    }
    return coefficients;
}

// Makes a rate that is round-off of its terms, whose absolute values add up to `size`, zero.
void drop_round_off(Complex& rate, double size) {
    if (std::abs(rate) <= round_off::zero * size) rate = 0.0;
}

// Every eigenpair a part of its own.
MotionParts single_parts(const Matrix& system, const Eigenpairs& pairs) {
    const std::vector<int> places = upper(pairs.rates);
    const Eigenpairs better = refined(system, pairs, places);
    MotionParts parts{better.rates, better.vectors, {}, {}, {}};
    parts.inverse = real_part_inverse(parts.vectors, pairs.rates(places));
    const Matrix sizes = system.cwiseAbs() * parts.vectors.cwiseAbs();  // of the terms of A V
    for (int j = 0; j < parts.size(); ++j) {
        drop_round_off(parts.rates[j], parts.inverse.row(j).cwiseAbs().dot(sizes.col(j)));
    }
    parts.mixing = ComplexMatrix(parts.rates.asDiagonal());
    for (int j = 0; j < parts.size(); ++j) parts.groups.push_back({j, j + 1});
    return parts;
}

// The places of the rates in every cluster, in which each is within a distance of another.
std::vector<std::vector<int>> clusters_of(const ComplexVector& rates, double distance) {
    const int n = static_cast<int>(rates.size());
    std::vector<std::vector<int>> clusters;
    std::vector<char> is_placed(n, false);
    for (int i = 0; i < n; ++i) {
        if (is_placed[i]) continue;
        std::vector<int> members{i};
        is_placed[i] = true;
        for (std::size_t k = 0; k < members.size(); ++k) {  // neighbours of neighbours
            for (int j = 0; j < n; ++j) {
                if (!is_placed[j] && std::abs(rates[members[k]] - rates[j]) <= distance) {
                    members.push_back(j);
                    is_placed[j] = true;
                }
            }
        }
        std::sort(members.begin(), members.end());
        clusters.push_back(members);
    }
    return clusters;
}

// Whether the conjugate of a member is, within a distance, a member too.
bool contains_conjugates(const ComplexVector& rates, const std::vector<int>& members, double distance) {
    for (const int i : members) {
        for (const int j : members) {
            if (std::abs(rates[i] - std::conj(rates[j])) <= distance) return true;
        }
    }
    return false;
}

// An orthonormal basis V (s, m) of the motions of a cluster, and T (m, m).
struct Cluster {
    ComplexMatrix vectors;
    ComplexMatrix mixing;
    bool is_doubled = false;  // it stands for its conjugate too

    Complex centre() const {
        const Complex mean = mixing.diagonal().mean();
        return is_doubled ? mean : Complex(mean.real());
    }
};

std::vector<Cluster> upper_clusters(const Schur& schur, double distance) {
    const ComplexVector rates = schur.triangle.diagonal();
    const double size = schur.triangle.norm();
    std::vector<Cluster> result;
    for (const std::vector<int>& members : clusters_of(rates, distance)) {
        const bool is_real = contains_conjugates(rates, members, distance);
        if (rates(members).imag().mean() < 0.0 && !is_real) continue;  // the conjugate of another
        Schur ordered = schur;
        ordered.bring_forward(members);
        const Index m = static_cast<Index>(members.size());
        Cluster cluster{ordered.basis.leftCols(m), ordered.triangle.topLeftCorner(m, m), !is_real};
        for (Complex& rate : cluster.mixing.diagonal()) drop_round_off(rate, size);
        result.push_back(cluster);
    }
    return result;
}

// The parts of clusters of rates; none where these are not distinct either.
std::optional<MotionParts> clustered_parts(const Schur& schur, double distance) {
    const std::vector<Cluster> clusters = upper_clusters(schur, distance);
    const Index s = schur.triangle.rows();
    Index count = 0, doubled = 0;
    for (const Cluster& cluster : clusters) {
        count += cluster.vectors.cols();
        if (cluster.is_doubled) doubled += cluster.vectors.cols();
    }
    if (count + doubled != s) return std::nullopt;
    MotionParts parts{ComplexVector(count), ComplexMatrix(s, count), {}, ComplexMatrix::Zero(count, count), {}};
    ComplexMatrix basis(s, s);
    Vector weights(count);
    Index first = 0, last = count;
    for (const Cluster& cluster : clusters) {
        const Index m = cluster.vectors.cols();
        basis.middleCols(first, m) = cluster.vectors;
        if (cluster.is_doubled) {
            basis.middleCols(last, m) = cluster.vectors.conjugate();
            last += m;
        }
        parts.rates.segment(first, m).setConstant(cluster.centre());
        parts.mixing.block(first, first, m, m) = cluster.mixing.triangularView<Eigen::Upper>();
        weights.segment(first, m).setConstant(cluster.is_doubled ? 2.0 : 1.0);
        parts.groups.push_back({static_cast<int>(first), static_cast<int>(first + m)});
        first += m;
    }
    if (!(condition(basis) < round_off::defective)) return std::nullopt;
    parts.vectors = basis.leftCols(count);
    parts.inverse = weights.cast<Complex>().asDiagonal() * inverse(basis).topRows(count);
    return parts;
}

}  // namespace

std::vector<ComplexMatrix> MotionParts::powers(const Range& part) const {
    const Index m = part.end - part.first, count = m > 1 ? m + beyond : 1;
    const ComplexMatrix identity = ComplexMatrix::Identity(m, m);
    const ComplexMatrix nilpotent = mixing.block(part.first, part.first, m, m) - rates[part.first] * identity;
    std::vector<ComplexMatrix> result{identity};
    for (Index d = 1; d < count; ++d) result.push_back(result.back() * nilpotent / static_cast<double>(d));
    return result;
}

MotionParts motion_parts(const Matrix& system) {
    const Eigenpairs pairs = eigenpairs(system);
    const double vectors_condition = condition_of(pairs);
    if (vectors_condition < round_off::defective) return single_parts(system, pairs);
    const Schur schur = complex_schur(system);
    const double fastest = schur.triangle.diagonal().cwiseAbs().maxCoeff();
    for (const double distance : distances) {
        const std::optional<MotionParts> parts = clustered_parts(schur, distance * fastest);
        if (parts) return *parts;
    }
    if (vectors_condition < round_off::worst_condition) return single_parts(system, pairs);
    throw NumericalFailure(Cause::indistinct_modes);
}

}  // namespace multiphi
