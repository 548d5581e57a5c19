#include "bindings/bindings.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include <nanobind/ndarray.h>
#include <nanobind/stl/complex.h>
#include <nanobind/stl/vector.h>

#include "search.hpp"

namespace nb = nanobind;

namespace multiphi::bindings {

namespace {

using Rows = nb::ndarray<const Complex, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Sizes = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// A search with its signals.
class Search {
  public:
    Search(std::vector<int> powers, std::vector<Complex> rates, double unit, Rows coefficients,
           std::vector<double> constants, std::vector<double> noises, double refinement)
        : exponentials_(std::move(powers), std::move(rates), unit), search_(refinement) {
        const int count = static_cast<int>(coefficients.shape(0)), p = exponentials_.size();
        if (static_cast<int>(coefficients.shape(1)) != p) throw nb::value_error("coefficients: one column a rate");
        signals_.resize(count, p);
        for (int s = 0; s < count; ++s) {
            std::copy_n(coefficients.data() + s * p, p, signals_.row(s));
            signals_.constants[s] = constants[s];
            signals_.noises[s] = noises[s];
        }
    }

    nb::tuple first(double from, double horizon) {
        const Descent descent = search_.first(exponentials_, signals_, from, horizon);
        return nb::make_tuple(descent.outcome, descent.signal, descent.time, descent.details[0], descent.details[1]);
    }

    std::vector<int> simultaneous(int found, double time) {
        multiphi::simultaneous(exponentials_, signals_, found, time, fallen_, phi_);
        std::vector<int> all;
        for (int s = 0; s < signals_.count; ++s) {
            if (fallen_[s]) all.push_back(s);
        }
        return all;
    }

    std::vector<int> first_signs(Sizes sizes, int since) const {
        const int p = exponentials_.size();
        std::vector<int> signs;
        for (int s = 0; s < signals_.count; ++s) {
            std::vector<Complex> c(signals_.row(s), signals_.row(s) + p);
            std::vector<double> size(sizes.data() + s * p, sizes.data() + (s + 1) * p);
            const double constant = signals_.constants[s];
            signs.push_back(first_sign(exponentials_, c.data(), size.data(), {constant, std::abs(constant)}, since));
        }
        return signs;
    }

    long evaluations() const { return search_.evaluations(); }

  private:
    Exponentials exponentials_;
    SearchedSignals signals_;
    DescentSearch search_;
    std::vector<char> fallen_;
    std::vector<Complex> phi_;
};

}  // namespace

void bind_search(nb::module_& module) {
    module.attr("CUBIC_REMAINDER") = cubic_remainder;
    nb::enum_<Descent::Outcome>(module, "SearchOutcome", "What a search for the first descent finds.")
        .value("none", Descent::Outcome::none)
        .value("found", Descent::Outcome::found)
        .value("not_finite", Descent::Outcome::not_finite)
        .value("too_long", Descent::Outcome::too_long);
    nb::class_<Search>(module, "Search", "Search for the first descent of signals through zero, for tests.")
        .def(nb::init<std::vector<int>, std::vector<Complex>, double, Rows, std::vector<double>, std::vector<double>,
                      double>(),
             nb::arg("powers"), nb::arg("rates"), nb::arg("unit"), nb::arg("coefficients"), nb::arg("constants"),
             nb::arg("noises"), nb::arg("refinement"))
        .def("first", &Search::first, nb::arg("start"), nb::arg("horizon"),
             "Outcome, signal, time [s], and if it is too long sample distance and remaining time [s].")
        .def("simultaneous", &Search::simultaneous, nb::arg("found"), nb::arg("time"), "Signals that fall together.")
        .def("first_signs", &Search::first_signs, nb::arg("sizes"), nb::arg("since"), "Signs just after t = 0.")
        .def_prop_ro("evaluations", &Search::evaluations, "Samples taken in all searches so far.");
}

}  // namespace multiphi::bindings
