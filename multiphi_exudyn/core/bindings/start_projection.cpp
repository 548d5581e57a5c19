#include "start_projection.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/ndarray.h>

#include <stdexcept>

#include "bindings/bindings.hpp"

namespace nb = nanobind;

namespace multiphi::bindings {

namespace {

// x, x', y, y' of a start (4, n), the last two cleared of round-off in place.
using Vectors = nb::ndarray<double, nb::shape<4, -1>, nb::c_contig, nb::device::cpu>;

void check(const Matrix& sizes, const Vector& times, const Matrix& units, const Vector& bounds) {
    const Index n = times.size();
    const bool fit = sizes.rows() == n && sizes.cols() == n && units.rows() == bounds.size() && units.cols() == n;
    if (!fit) throw std::invalid_argument("StartProjection: need arrays of one number n of coordinates");
}

}  // namespace

void bind_start_projection(nb::module_& module) {
    nb::class_<StartProjection>(module, "StartProjection", "Whether a start touches nothing.")
        .def("__init__",
             [](StartProjection* self, const Matrix& sizes, const Vector& times, const Matrix& units,
                const Vector& bounds, double near) {
                 check(sizes, times, units, bounds);
                 new (self) StartProjection(sizes, times, units, bounds, near);
             }, nb::arg("sizes"), nb::arg("times"), nb::arg("units"), nb::arg("bounds"), nb::arg("near"))
        .def("is_far",
             [](const StartProjection& self, const Vectors& vectors) {
                 if (vectors.shape(1) != static_cast<std::size_t>(self.size())) {
                     throw std::invalid_argument("is_far: need vectors of n coordinates");
                 }
                 double* x = vectors.data();
                 const int n = self.size();
                 return self.is_far(x, x + n, x + 2 * n, x + 3 * n);
             }, nb::arg("vectors").noconvert());
}

}  // namespace multiphi::bindings
