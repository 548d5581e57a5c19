// Bindings of sampler.hpp: values of recorded motions as arrays.
#include "bindings/bindings.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include "sampler.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

namespace {

using Times = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Places = nb::ndarray<const int, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Rows = nb::DRef<Matrix>;

Vector values(Sampler& sampler, const Times& times, bool from_left, const Matrix& rows) {
    Vector result(static_cast<Index>(times.size()));
    const nb::gil_scoped_release released;
    sampler.values(times.data(), static_cast<int>(times.size()), from_left ? Side::left : Side::right, rows,
                   result.data());
    return result;
}

// xi and xi' (2 count, width), one after the other.
Matrix states(Sampler& sampler, const Places& segments, const Times& after, int width) {
    const int count = static_cast<int>(segments.size());
    Matrix result(2 * count, width);
    const nb::gil_scoped_release released;
    sampler.states(segments.data(), after.data(), count, width, result.data());
    return result;
}

std::pair<double, double> sizes(Sampler& sampler, double end) {
    double mean_square = 0.0, largest_energy = 0.0;
    const nb::gil_scoped_release released;
    sampler.sizes(end, mean_square, largest_energy);
    return {mean_square, largest_energy};
}

// Rates, powers, unit, shapes (n, p), coefficients (p,) and the number of terms of the free response.
auto closed_form(Sampler& sampler, int segment) {
    const Motion* motion = nullptr;
    {
        const nb::gil_scoped_release released;
        motion = &sampler.motion(segment);
    }
    const Exponentials& basis = motion->basis();
    const std::vector<Complex>& coefficients = motion->coefficients();
    return std::tuple(ComplexVector(ComplexVector::Map(basis.rates.data(), basis.size())),
                      std::vector<int>(basis.powers.begin(), basis.powers.end()), basis.unit, sampler.shapes(),
                      ComplexVector(ComplexVector::Map(coefficients.data(), basis.size())), motion->free_size());
}

}  // namespace

void bind_sampler(nb::module_& module) {
    nb::class_<Sampler>(module, "Sampler", "Values of a recorded motion at any times.")
        .def("__init__",
             [](Sampler* self, std::shared_ptr<Levels> levels, std::shared_ptr<Trajectory> trajectory) {
                 new (self) Sampler(std::move(levels), std::move(trajectory));
             },
             "levels"_a, "trajectory"_a)
        .def("values", values, "times"_a, "from_left"_a, "rows"_a,
             "row.(xi, xi', 1) at times [s]; rows (levels, 2 n + 1) by the level numbers of the trajectory")
        .def("states", states, "segments"_a, "after"_a, "width"_a,
             "xi, then xi', (2 count, width) of segments, times [s] after their starts")
        .def("sizes", sizes, "end"_a, "mean of |y|^2 and largest energy up to an end [s]")
        .def("works", &Sampler::works, "segments"_a, nb::call_guard<nb::gil_scoped_release>())
        .def("closed_form", closed_form, "segment"_a,
             "rates, powers, unit, shapes (n, p), coefficients (p,), number of terms of the free response");
}

}  // namespace multiphi::bindings
