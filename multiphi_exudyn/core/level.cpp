#include "level.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <numbers>
#include <utility>

#include "orthonormal.hpp"
#include "round_off.hpp"
#include "triangular_factor.hpp"
#include "work_forms.hpp"

namespace multiphi {

namespace {

Matrix sizes_of(const ComplexMatrix& map) {
    Matrix result(map.rows(), map.cols());
    for (Index j = 0; j < map.rows(); ++j)
        for (Index i = 0; i < map.cols(); ++i) result(j, i) = modulus(map(j, i));
    return result;
}

std::size_t bytes_of(const Matrix& matrix) { return sizeof(double) * static_cast<std::size_t>(matrix.size()); }
std::size_t bytes_of(const Vector& vector) { return sizeof(double) * static_cast<std::size_t>(vector.size()); }
std::size_t bytes_of(const ComplexMatrix& matrix) {
    return sizeof(Complex) * static_cast<std::size_t>(matrix.size());
}

}  // namespace

std::size_t Signal::bytes() const {
    return sizeof(Signal) + bytes_of(row.displacement) + bytes_of(row.velocity) +
           sizeof(Complex) * (exponentials.size() + velocity_exponentials.size());
}

// What is made when it is first asked for.
struct Level::Derived {
    std::once_flag has_strain, has_sizes, has_defects, has_work_forms;
    StrainForm strain;
    Matrix size_factor;
    Vector static_work, struck_defects;
    WorkForms work_forms;
    std::atomic<std::size_t> bytes = 0;  // of the forms of works, the largest of these
};

void Level::renew_derived() { derived_ = std::make_shared<Derived>(); }

Level::Level(const Model& model, const Excitation& excitation, LevelData data, int number)
    : model_(&model), excitation_(&excitation), data_(std::move(data)), number_(number),
      modes_(static_cast<int>(data_.squares.size())), channels_(excitation.channels()),
      prescribed_(excitation.prescribed), derived_(std::make_shared<Derived>()) {
    describe_modes();
    describe_motion();
    describe_potential();
    describe_channels();
    describe_guards();
}

Level Level::of_base(const Model& model, const Excitation& excitation) { return Level(model, excitation); }

Level::Level(const Model& model, const Excitation& excitation)
    : model_(&model), excitation_(&excitation), modes_(model.base.modes()), channels_(excitation.channels()),
      prescribed_(excitation.prescribed), omega_(model.base.omega), periods_(model.base.periods),
      derived_(std::make_shared<Derived>()) {
    const int m = modes_, q = channels_, n = width();
    const Base& base = model.base;
    data_.key.assign(model.elements.size(), 0);
    data_.squares = data_.computed = base.squares;
    data_.gap_rows.resize(base.links(), n);
    data_.gap_rows << base.directions, -excitation.stops;
    data_.gap_constants = model.gaps;
    data_.velocity_rows = data_.gap_rows;
    centre_.setZero(m);
    first_guards_.assign(model.elements.size() + 1, 0);
    patterns_.setZero(q, n + 1);
    patterns_.leftCols(m) = excitation.patterns.transpose();
    potential_.constant = base.energy_offset;
    potential_.linear.setZero(n);
    potential_.linear.head(m) = -base.preload - excitation.static_load;
    potential_.squares = base.squares;
    potential_.rows = -patterns_.leftCols(n);
    potential_.follows.resize(0, n + 1);
}

void Level::describe_modes() {
    omega_.resize(modes_);
    periods_.resize(modes_);
    highest_frequency_ = excitation_->highest_frequency;
    for (int i = 0; i < modes_; ++i) {
        omega_[i] = std::sqrt(std::abs(data_.squares[i]));
        periods_[i] = omega_[i] > 0.0 ? 1.0 / omega_[i] : 0.0;
        if (data_.squares[i] > 0.0)
            highest_frequency_ = std::max(highest_frequency_, omega_[i] / (2.0 * std::numbers::pi));
    }
    response_ = modal_response(data_.squares, data_.damping_matrix, data_.coupling, data_.duration);
    if (prescribed_ > 0) {
        response_sizes_[0] = sizes_of(response_.from_displacement);
        response_sizes_[1] = sizes_of(response_.from_velocity);
        response_sizes_[2] = sizes_of(response_.from_force);
    }
}

void Level::describe_motion() {
    displacement_acceleration_.resize(modes_, width());
    velocity_acceleration_.resize(modes_, width());
    displacement_acceleration_ << -data_.coupling, data_.channel_force;
    velocity_acceleration_ << -data_.damping_matrix, data_.channel_force_rate;
    displacement_acceleration_.diagonal() -= data_.squares;
    constant_acceleration_ = data_.drive;
    centre_.setZero(modes_);
    const Index held = channels_ - prescribed_;
    drives_free_modes_ = (data_.drive.array() != 0.0).any() ||
                         (data_.channel_force.rightCols(held).array() != 0.0).any();
}

std::vector<int> Level::springs() const {
    std::vector<int> result;
    for (const int link : data_.links)
        if (std::isfinite(model_->base.stiffnesses[link])) result.push_back(link);
    return result;
}

Row Level::stretch(int element) const {
    const Element& described = model_->elements[element];
    const ElementState& state = described.states[data_.key[element]];
    Row row{Vector::Zero(width()), Vector::Zero(width()), state.stretch, false};
    if (!state.ratio) return row;
    const auto place = std::find(data_.links.begin(), data_.links.end(), state.ratio->link) - data_.links.begin();
    const double stiffness = model_->base.stiffnesses[described.stick.link];
    row.displacement = state.ratio->ratio * data_.force_rows.row(place).transpose() / stiffness;
    row.constant += state.ratio->ratio * data_.forces[place] / stiffness;
    return row;
}

Matrix Level::stretches() const {
    std::vector<int> following;
    for (int i = 0; i < model_->size(); ++i) {
        const Element& element = model_->elements[i];
        if (element.states[data_.key[i]].ratio && std::isfinite(model_->base.stiffnesses[element.stick.link]))
            following.push_back(i);
    }
    Matrix result(static_cast<Index>(following.size()), width() + 1);
    for (std::size_t k = 0; k < following.size(); ++k) {
        const Row row = stretch(following[k]);
        const double stiffness = model_->base.stiffnesses[model_->elements[following[k]].stick.link];
        result.row(static_cast<Index>(k)) << row.displacement.transpose(), row.constant;
        result.row(static_cast<Index>(k)) *= std::sqrt(stiffness);
    }
    return result;
}

Matrix Level::motion_shapes() const {
    Matrix result(model_->base.modes(), width() + 1);
    if (is_base()) return result.setIdentity();
    result << data_.shapes(), data_.channel_shapes, data_.configuration;
    return result;
}

void Level::describe_potential() {
    const Base& base = model_->base;
    const int r = modes_, q = channels_, n = width();
    const Vector& y = data_.configuration;
    potential_.constant = data_.strain + data_.stored - excitation_->static_load.dot(y);
    potential_.squares = data_.squares;
    potential_.follows = stretches();
    potential_.linear.setZero(n);
    potential_.linear.head(r) = -data_.static_drive;
    if (base.general)  // constant forces of elements
        potential_.linear.head(r) += data_.shapes().transpose() * (data_.load - excitation_->static_load);
    potential_.rows.resize(q, n);
    if (q == 0) return;
    const Matrix shapes = motion_shapes().leftCols(n);
    const Matrix bent = data_.channel_shapes.transpose() * base.squares.asDiagonal();
    const Matrix pulled = excitation_->patterns.transpose() * shapes;
    const Vector load = base.squares.cwiseProduct(y) - base.preload - excitation_->static_load;
    potential_.rows = bent * shapes - pulled;
    potential_.linear.tail(q) = data_.channel_shapes.transpose() * load - excitation_->patterns.transpose() * y;
    for (const int link : springs()) {
        const Vector on_channels = base.stiffnesses[link] * data_.gap_rows.row(link).tail(q).transpose();
        potential_.rows += on_channels * data_.gap_rows.row(link);
        potential_.linear.tail(q) += on_channels * data_.gap_constants[link];
    }
    potential_.rows.rightCols(q) -= pulled.rightCols(q).transpose();
}

void Level::describe_channels() {
    patterns_ = excitation_->patterns.transpose() * motion_shapes();
    if ((data_.carried.array() == 0.0).all()) return;
    carried_.resize(channels_, width());
    carried_ << data_.carried.transpose() * data_.modes, data_.carried.transpose() * data_.carried;
}

void Level::describe_guards() {
    first_guards_.assign(1, 0);
    for (int i = 0; i < model_->size(); ++i) {
        for (const GuardForm& form : model_->elements[i].states[data_.key[i]].guards) {
            Guard guard{i, form.target, form.rule, signal(form), std::nullopt};
            if (form.by_velocity) {
                GuardForm velocity;
                velocity.shares.push_back(Share{form.by_velocity->link, 0.0, 1.0, 0.0});
                guard.by_velocity = {signal(velocity), form.by_velocity->forward, form.by_velocity->backward};
            }
            guards_.push_back(std::move(guard));
        }
        first_guards_.push_back(static_cast<int>(guards_.size()));
    }
}

const Guard& Level::opening(int element) const {
    int guard = first_guard(element);
    while (guards_[guard].target != open_state) ++guard;
    return guards_[guard];
}

Signal Level::signal(const GuardForm& form) const {
    Row row{Vector::Zero(width()), Vector::Zero(width()), 0.0, false};
    round_off::Sum constant;
    constant.add(form.constant);
    for (const Share& share : form.shares) {
        row.displacement += share.gap * data_.gap_rows.row(share.link).transpose();
        row.velocity += share.velocity * data_.gap_rows.row(share.link).transpose();
        constant.add(share.gap * data_.gap_constants[share.link]);
        if (share.force == 0.0) continue;
        const auto place = std::find(data_.links.begin(), data_.links.end(), share.link) - data_.links.begin();
        row.displacement += share.force * data_.force_rows.row(place).transpose();
        row.velocity += share.force * data_.force_velocity_rows.row(place).transpose();
        constant.add(share.force * data_.forces[place]);
    }
    // The difference of a load and a limit may be round-off of them.
    row.constant = constant.sign() != 0 ? constant.value : 0.0;
    return signal_of(std::move(row));
}

Signal Level::signal_of(Row row) const {
    const int p = response_.basis.size();
    Signal result;
    row.depends_on_velocity = (row.velocity.array() != 0.0).any();
    result.exponentials.resize(p);
    result.velocity_exponentials.resize(row.depends_on_velocity ? p : 0);
    for (int j = 0; j < p; ++j) {
        Complex value = 0.0, rate = 0.0;
        for (int i = response_.reached[j].first; i < response_.reached[j].end; ++i) {
            value += row.displacement[i] * response_.shapes(j, i);
            if (row.depends_on_velocity) rate += row.velocity[i] * response_.shapes(j, i);
        }
        result.exponentials[j] = value;
        if (row.depends_on_velocity) result.velocity_exponentials[j] = rate;
    }
    result.row = std::move(row);
    return result;
}

const StrainForm& Level::strain() const {
    std::call_once(derived_->has_strain, [this] { derived_->strain = make_strain(); });
    return derived_->strain;
}

StrainForm Level::make_strain() const {
    const Base& base = model_->base;
    const int n = width();
    const Matrix shapes = motion_shapes();
    const Matrix bent = triangular_factor(model_->base.omega.asDiagonal() * shapes);
    const std::vector<int> links = springs();
    std::vector<int> given;  // modes whose frequency was given
    for (int i = 0; i < modes_; ++i)
        if (data_.squares[i] != data_.computed[i]) given.push_back(i);
    const Index following = potential_.follows.rows();
    const Index count = bent.rows() + static_cast<Index>(links.size() + given.size()) + following;
    StrainForm form;
    form.weights.setOnes(count);
    Matrix rows = Matrix::Zero(count, n + 1);
    rows.topRows(bent.rows()) = bent;
    Index next = bent.rows();
    for (const int link : links) {
        rows.row(next) << data_.gap_rows.row(link), data_.gap_constants[link];
        form.weights[next++] = base.stiffnesses[link];
    }
    for (const int mode : given) {
        rows(next, mode) = 1.0;
        form.weights[next++] = data_.squares[mode] - data_.computed[mode];
    }
    rows.bottomRows(following) = potential_.follows;
    form.rows = rows.leftCols(n);
    form.offsets = rows.col(n);
    const Vector linear = -(shapes.transpose() * base.preload);
    form.linear = linear.head(n);
    form.constant = base.energy_offset + data_.stored + linear[n];
    return form;
}

const Matrix& Level::size_factor() const {
    std::call_once(derived_->has_sizes, [this] {
        const Matrix shapes = motion_shapes();
        derived_->size_factor = triangular_factor(shapes);
        derived_->static_work = shapes.transpose() * excitation_->static_load;
    });
    return derived_->size_factor;
}

const Vector& Level::static_work() const {
    size_factor();
    return derived_->static_work;
}

const Vector& Level::struck_defects() const {
    std::call_once(derived_->has_defects, [this] { derived_->struck_defects = make_struck_defects(); });
    return derived_->struck_defects;
}

const WorkForms& Level::work_forms() const {
    std::call_once(derived_->has_work_forms, [this] {
        derived_->work_forms = multiphi::work_forms(*this);
        derived_->bytes = derived_->work_forms.bytes();
    });
    return derived_->work_forms;
}

Vector Level::make_struck_defects() const {
    const Base& base = model_->base;
    Vector result = Vector::Constant(model_->size(), std::numeric_limits<double>::quiet_NaN());
    if (model_->has_friction || is_base()) return result;
    std::vector<Index> contacts, held;
    for (int i = 0; i < model_->size(); ++i)
        if (model_->elements[i].is_rigid()) contacts.push_back(i);
    for (const int link : data_.links)
        if (base.constrains(link)) held.push_back(link);
    if (contacts.empty()) return result;
    // An impulse along h moves the modes to Psi Psi^T h; Q keeps of it what is orthogonal to h and to what is closed.
    Matrix along = base.directions(contacts, Eigen::all), modes = data_.modes.transpose();
    const Matrix pushed = along * data_.modes;
    if (!held.empty()) {
        const Matrix directions = base.directions(held, Eigen::all);
        along = without(directions, along);
        modes = without(directions, modes);
    }
    const Matrix moved = pushed * modes;
    for (Index k = 0; k < along.rows(); ++k) {
        const double square = along.row(k).squaredNorm();
        const double share = square > 0.0 ? along.row(k).dot(moved.row(k)) / square : 0.0;
        const Vector left = (moved.row(k) - share * along.row(k)).transpose().cwiseProduct(model_->base.periods);
        result[contacts[static_cast<std::size_t>(k)]] = left.squaredNorm();
    }
    return result;
}

std::size_t Level::bytes() const {
    std::size_t total = sizeof(Level) + sizeof(int) * (data_.key.size() + data_.links.size() + first_guards_.size());
    for (const Matrix* part :
         {&data_.damping_matrix, &data_.coupling, &data_.damping, &data_.modes, &data_.bending, &data_.gap_rows, &data_.velocity_rows,
          &data_.force_rows, &data_.force_velocity_rows, &data_.channel_force, &data_.channel_force_rate,
          &data_.channel_shapes, &data_.carried, &displacement_acceleration_, &velocity_acceleration_,
          &potential_.rows, &potential_.follows, &patterns_, &carried_, &response_sizes_[0], &response_sizes_[1],
          &response_sizes_[2]})
        total += bytes_of(*part);
    for (const ComplexMatrix* part :
         {&response_.from_displacement, &response_.from_velocity, &response_.from_force, &response_.shapes})
        total += bytes_of(*part);
    for (const Guard& guard : guards_) {
        total += sizeof(Guard) + guard.signal.bytes();
        if (guard.by_velocity) total += guard.by_velocity->velocity.bytes();
    }
    return total + derived_->bytes;
}

}  // namespace multiphi
