#include "bindings/bindings.hpp"

#include <limits>
#include <optional>
#include <string>
#include <utility>

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/complex.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include "forced_response.hpp"
#include "light_damping.hpp"
#include "motion_parts.hpp"
#include "response.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace multiphi::bindings {

namespace {

using Flags = Eigen::Array<bool, Eigen::Dynamic, 1>;

Flags flags(const std::vector<char>& values) {
    Flags result(values.size());
    for (std::size_t i = 0; i < values.size(); ++i) result[i] = values[i];
    return result;
}

// Throws where an array has not as many numbers as it needs.
void need(const char* name, Index rows, Index columns, Index needed_rows, Index needed_columns) {
    if (rows == needed_rows && columns == needed_columns) return;
    const std::string got = std::to_string(rows) + ", " + std::to_string(columns);
    const std::string needed = std::to_string(needed_rows) + ", " + std::to_string(needed_columns);
    const std::string text = std::string(name) + ": got shape (" + got + "), need (" + needed + ")";
    throw nb::value_error(text.c_str());
}

void need_size(const char* name, const Vector& vector, Index size) { need(name, vector.size(), 1, size, 1); }

ModalResponse response_of(const Vector& squares, const Matrix& damping, const std::optional<Matrix>& coupling,
                          double duration) {
    const Index r = squares.size();
    need("damping", damping.rows(), damping.cols(), r, r);
    if (coupling) need("coupling", coupling->rows(), coupling->cols(), r, r);
    return modal_response(squares, damping, coupling.value_or(Matrix()), duration);
}

std::optional<ModalResponse> light_response_of(const Vector& squares, const Matrix& damping) {
    need("damping", damping.rows(), damping.cols(), squares.size(), squares.size());
    return lightly_damped_response(squares, damping);
}

// The basis as the package's own functions on arrays of times.
nb::object basis_of(const ModalResponse& response) {
    const Exponentials& basis = response.basis;
    const ComplexVector rates = Eigen::Map<const ComplexVector>(basis.rates.data(), basis.size());
    const Eigen::Matrix<int64_t, Eigen::Dynamic, 1> powers =
        Eigen::Map<const Eigen::VectorXi>(basis.powers.data(), basis.size()).cast<int64_t>();
    const nb::module_ home = nb::module_::import_("multiphi_exudyn.mathematics.exponentials");
    return home.attr("Exponentials")(rates, powers, basis.unit);
}

ComplexVector coefficients_of(const ModalResponse& response, const Vector& displacement, const Vector& velocity,
                              const std::optional<Vector>& force) {
    need_size("displacement", displacement, response.modes);
    need_size("velocity", velocity, response.modes);
    if (force) need_size("force", *force, response.modes);
    ComplexVector c(response.basis.size());
    response.coefficients(displacement.data(), velocity.data(), force ? force->data() : nullptr, c.data());
    return c;
}

std::pair<Vector, Vector> state_of(const ModalResponse& response, const ComplexVector& c, double t) {
    need("coefficients", c.size(), 1, response.basis.size(), 1);
    Vector eta(response.modes), eta_t(response.modes);
    std::vector<Complex> memory;
    response.state_at(c.data(), t, memory, eta.data(), eta_t.data());
    return {eta, eta_t};
}

std::vector<std::pair<int, int>> reached_of(const ModalResponse& response) {
    std::vector<std::pair<int, int>> result;
    for (const Range& range : response.reached) result.emplace_back(range.first, range.end);
    return result;
}

ComplexMatrix rows_of(ForcedResponse& forced, const ModalResponse& response, Complex rate, const ComplexMatrix& forces,
                      double unit, const std::optional<Vector>& displacement, const std::optional<Vector>& velocity) {
    if (forces.rows() == 0) throw nb::value_error("forces: got no rows, need one for each power of time");
    need("forces", forces.rows(), forces.cols(), forces.rows(), response.modes);
    if (displacement.has_value() != velocity.has_value()) {
        throw nb::value_error("motion: got one of displacement and velocity, need both or none");
    }
    if (displacement) {
        need_size("displacement", *displacement, response.modes);
        need_size("velocity", *velocity, response.modes);
    }
    forced.compute(response, rate, forces, static_cast<int>(forces.rows()) - 1, unit,
                   displacement ? displacement->data() : nullptr, velocity ? velocity->data() : nullptr);
    return forced.rows();
}

ComplexMatrix particular(const ModalResponse& response, Complex rate, const ComplexMatrix& forces, double unit) {
    ForcedResponse forced;
    return rows_of(forced, response, rate, forces, unit, std::nullopt, std::nullopt);
}

MotionParts parts_of(const Matrix& system) {
    need("system", system.rows(), system.cols(), system.rows(), system.rows());
    return motion_parts(system);
}

}  // namespace

void bind_response(nb::module_& module) {
    nb::class_<Chain>(module, "Chain", "Components y of a motion: y' = mixing y + pushes p, eta = ... + Re shapes y.")
        .def_prop_ro("mixing", [](const Chain& chain) { return chain.mixing; })
        .def_prop_ro("shapes", [](const Chain& chain) { return ComplexMatrix(chain.shapes.transpose()); })
        .def_prop_ro("pushes", [](const Chain& chain) { return chain.pushes; });
    nb::class_<ModalResponse>(module, "ModalResponse", "The free motion of modal equations in closed form.")
        .def_ro("modes", &ModalResponse::modes)
        .def_prop_ro("basis", &basis_of,
                     nb::sig("def basis(self, /) -> multiphi_exudyn.mathematics.exponentials.Exponentials"))
        .def_prop_ro("shapes", [](const ModalResponse& response) { return ComplexMatrix(response.shapes.transpose()); })
        .def_prop_ro("from_displacement", [](const ModalResponse& response) { return response.from_displacement; })
        .def_prop_ro("from_velocity", [](const ModalResponse& response) { return response.from_velocity; })
        .def_prop_ro("from_force", [](const ModalResponse& response) { return response.from_force; })
        .def_prop_ro("alone", [](const ModalResponse& response) { return flags(response.uncoupled); })
        .def_prop_ro("poles", [](const ModalResponse& response) { return flags(response.poles); })
        .def_prop_ro("reached", &reached_of)
        .def_prop_ro("chains", [](const ModalResponse& response) { return response.chains; })
        .def("coefficients", &coefficients_of, "displacement"_a, "velocity"_a, "force"_a = nb::none(),
             "Coefficients (p,) of the motion from eta, eta' (r,) under a modal force (r,).")
        .def("state", &state_of, "coefficients"_a, "t"_a, "eta(t), eta'(t), both (r,).");
    module.def("modal_response", &response_of, "squares"_a, "damping"_a, "coupling"_a = nb::none(),
               "duration"_a = std::numeric_limits<double>::infinity(),
               "The closed form for omega^2 (r,), damping and coupling (r, r), of motions of at most that duration.");
    module.def("lightly_damped_response", &light_response_of, "squares"_a, "damping"_a,
               "The closed form of modes that light damping couples; None for others.");
    nb::class_<ForcedResponse>(module, "ForcedResponse", "The response to a load that is a polynomial on a carrier.")
        .def(nb::init<>())
        .def("compute", &rows_of, "response"_a, "rate"_a, "forces"_a, "unit"_a, "displacement"_a = nb::none(),
             "velocity"_a = nb::none(), "x (rows, r) in powers of t / unit, beside a motion.");
    module.def("particular", &particular, "response"_a, "rate"_a, "forces"_a, "unit"_a,
               "x (rows, r) in powers of t / unit, of the response to forces (degree + 1, r) on a carrier.");
    nb::class_<MotionParts>(module, "MotionParts", "Independent parts of a linear motion z' = A z.")
        .def_prop_ro("rates", [](const MotionParts& parts) { return parts.rates; })
        .def_prop_ro("vectors", [](const MotionParts& parts) { return parts.vectors; })
        .def_prop_ro("inverse", [](const MotionParts& parts) { return parts.inverse; })
        .def_prop_ro("mixing", [](const MotionParts& parts) { return parts.mixing; });
    module.def("motion_parts", &parts_of, "system"_a, "The parts of z' = A z.");
}

}  // namespace multiphi::bindings
