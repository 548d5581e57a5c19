#include "orthonormal.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "bindings/bindings.hpp"

namespace nb = nanobind;

namespace multiphi::bindings {

namespace {

using Given = Eigen::Ref<const Matrix>;
using GivenVector = Eigen::Ref<const Vector>;

void require(bool holds, const char* need) {
    if (!holds) throw std::invalid_argument(need);
}

void check_links(const Given& directions, const GivenVector& lengths, const std::vector<int>& held) {
    require(lengths.size() == directions.rows(), "lengths: need one of every direction");
    for (const int link : held) require(link >= 0 && link < directions.rows(), "held: need numbers of directions");
}

}  // namespace

void bind_orthonormal(nb::module_& module) {
    module.def(
        "without",
        [](const Given& directions, const Given& vectors) {
            require(directions.cols() == vectors.cols(), "without: need directions and vectors of one length");
            return without(directions, vectors);
        },
        nb::arg("directions"), nb::arg("vectors"),
        "The part of vectors (k, m) that is orthogonal to directions (d, m).");
    module.def(
        "largest_product_error",
        [](const Given& vectors) {
            return largest_product_error(vectors.data(), static_cast<int>(vectors.cols()),
                                         static_cast<int>(vectors.rows()));
        },
        nb::arg("vectors"), "The largest element of |V V^T - I|, V (r, m).");
    module.def(
        "are_independent",
        [](const Given& directions, const GivenVector& lengths, const std::vector<int>& held) {
            check_links(directions, lengths, held);
            OrthonormalBasis basis;
            return span(directions, lengths, held, basis);
        },
        nb::arg("directions"), nb::arg("lengths"), nb::arg("held"),
        "Whether the held ones of directions (l, m) of these lengths (l,) are linearly independent.");
    module.def(
        "following",
        [](const Given& directions, const GivenVector& lengths, const std::vector<int>& held) {
            check_links(directions, lengths, held);
            OrthonormalBasis basis;
            require(span(directions, lengths, held, basis), "held: need independent directions");
            return following(directions, lengths, basis);
        },
        nb::arg("directions"), nb::arg("lengths"), nb::arg("held"),
        "Which of directions (l, m) the held ones determine, and which are zero.");
}

}  // namespace multiphi::bindings
