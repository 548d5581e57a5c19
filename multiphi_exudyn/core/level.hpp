// Level: the linear system that holds while every element keeps its state (eqs. 38.2 to 38.5).
//
//     x = Psi eta + y_inf + R w                                                   (38.4)
//     eta'' + D eta' + S eta = P w + Q w' + drive                                 (38.3)
//
// xi = (eta, w) (n,) are its coordinates, r modes and q channels. Gaps, contact forces, guards and energies are linear
// or quadratic in xi and xi'. A level is made once, from what levels/ computes (LevelData), and never changes, but for
// the constants of one under held forces (held_forces.hpp).
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "excitation.hpp"
#include "linear_algebra.hpp"
#include "model.hpp"
#include "response.hpp"

namespace multiphi {

struct WorkForms;

using Key = std::vector<int>;  // the state of every element

// A linear function of the coordinates of a level: displacement.xi + velocity.xi' + constant.
struct Row {
    Vector displacement, velocity;  // (n,)
    double constant = 0.0;
    bool depends_on_velocity = false;
};

// A row with its coefficients on the exponentials of the free response (p,); the second ones empty if not needed.
struct Signal {
    Row row;
    std::vector<Complex> exponentials, velocity_exponentials;

    std::size_t bytes() const;
};

// Target that depends on the sign of a velocity, see TargetByVelocity.
struct VelocityTarget {
    Signal velocity;
    int forward = 0, backward = 0;
};

// A way out of the present state of an element: its signal is not negative as long as the state may last.
struct Guard {
    int element = 0, target = 0;
    Rule rule = Rule::may_recover;
    Signal signal;
    std::optional<VelocityTarget> by_velocity;
};

// constant + linear.xi + 1/2 squares.eta^2 + w.(rows eta + 1/2 rows w) + 1/2 |follows (xi, 1)|^2, rows (q, n): the
// strain energy less the potential of static loads. `follows` (s, n + 1): springs whose stretch follows the force of a
// link.
struct PotentialForm {
    double constant = 0.0;
    Vector linear, squares;
    Matrix rows, follows;
};

// 1/2 weights.(rows xi + offsets)^2 + linear.xi + constant: the strain energy, no difference of large energies.
struct StrainForm {
    Vector weights, offsets, linear;
    Matrix rows;
    double constant = 0.0;
};

// What levels/ computes of a level, in base coordinates and in xi; the core makes the rest of it.
struct LevelData {
    Key key;
    std::vector<int> links;                  // that act in it
    Vector squares;                          // omega^2 (r,), negative for growing modes
    Vector computed;                         // the same as computed from M and K: those of `squares` may be given
    Matrix damping_matrix, coupling;         // D and S - diag(omega^2) (r, r), friction of sliding contacts included
    Matrix damping;                          // (r, r) of the structure and its links alone
    Matrix modes;                            // Psi (m, r), what has inertia of them
    Matrix bending;                          // (m, r) what follows them without inertia (residual_boundary.hpp), or empty
    Vector configuration;                    // y_inf (m,), the asymptotic configuration
    Vector drive;                            // (r,) static load on zero-frequency modes,
    Vector static_drive;                     //   (r,) the same before a steady channel takes it over
    Vector load;                             // (m,) static loads, with constant forces of elements
    double strain = 0.0;                     // [J] in the asymptotic configuration
    double stored = 0.0;                     // [J] of links that keep a stretch without acting
    Matrix gap_rows;                         // gaps (l, n) from xi,
    Vector gap_constants;                    //   (l,) at xi = 0
    Matrix velocity_rows;                    // gap velocities (l, n) from xi', in impacts
    Matrix force_rows, force_velocity_rows;  // forces (k, n) of the links that act, from xi and xi',
    Vector forces;                           //   (k,) at xi = 0
    Matrix channel_force, channel_force_rate;  // P, Q (r, q)
    Matrix channel_shapes, carried;          // R (m, q); Y (m, q): the motion that rigid stops carry with them
    std::optional<Matrix> mobility;          // B = F F^T (r, r) that attached bodies leave to impacts
    double duration = std::numeric_limits<double>::infinity();  // longest motion in it [s]

    // The motion (m, r) at unit eta: the modes, with what bends without inertia.
    Matrix shapes() const { return bending.size() > 0 ? Matrix(modes + bending) : modes; }
};

// A constant force that others hold on the structure in a level: on its modes (s,), s >= r, and the direct reactions
// (k,) [N] of the links that act, which its modes do not contain.
struct HeldForce {
    Vector modal, reactions;
};

// S^-1 (r, r) of a level on the modes of nonzero frequency; 1 - S S^-1 on the others, empty if there are none.
struct Compliance {
    Matrix inverse, free_share;

    explicit Compliance(const LevelData& level);
};

class Level {
  public:
    Level(const Model& model, const Excitation& excitation, LevelData data, int number);

    // The base as a level, all contacts open, with xi = (y, w): starts are given in it. It has no guards and no
    // response. Its key: the first state of every element.
    static Level of_base(const Model& model, const Excitation& excitation);

    const LevelData& data() const { return data_; }
    const Model& model() const { return *model_; }
    const Excitation& excitation() const { return *excitation_; }
    const Key& key() const { return data_.key; }
    int number() const { return number_; }               // -1 of the base
    bool is_base() const { return number_ < 0; }
    int modes() const { return modes_; }                 // r
    int channels() const { return channels_; }           // q
    int prescribed() const { return prescribed_; }
    int width() const { return modes_ + channels_; }     // n
    int state(int element) const { return data_.key[element]; }
    bool is_closed_rigid(int element) const {
        return model_->elements[element].is_rigid() && data_.key[element] != open_state;
    }

    const Vector& omega() const { return omega_; }       // |omega| (r,)
    const Vector& periods() const { return periods_; }   // 1 / |omega|, zero where omega is zero
    double highest_frequency() const { return highest_frequency_; }  // [Hz] of modes and loads
    const ModalResponse& response() const { return response_; }

    // eta'' = displacement_acceleration xi + velocity_acceleration xi' + constant_acceleration
    const Matrix& displacement_acceleration() const { return displacement_acceleration_; }  // (r, n)
    const Matrix& velocity_acceleration() const { return velocity_acceleration_; }          // (r, n)
    const Vector& constant_acceleration() const { return constant_acceleration_; }          // (r,)
    // Whether static loads or held channels act on zero-frequency modes.
    bool drives_free_modes() const { return drives_free_modes_; }

    const std::vector<Guard>& guards() const { return guards_; }  // in the order of the elements
    int first_guard(int element) const { return first_guards_[element]; }
    int end_guard(int element) const { return first_guards_[element + 1]; }
    // The guard by which a closed contact opens.
    const Guard& opening(int element) const;
    // The signal of a guard's form in this level, for forms of other states too.
    Signal signal(const GuardForm& form) const;
    Signal signal_of(Row row) const;

    // The stretch [m] of an element's friction spring while it slips, a row of xi and its constant.
    Row stretch(int element) const;

    const PotentialForm& potential() const { return potential_; }
    const Matrix& patterns() const { return patterns_; }  // (q, n + 1): work of varying loads, w.(patterns (xi, 1))
    const Matrix& carried() const { return carried_; }    // (q, n) of the kinetic energy; empty if stops stand still
    // |A|, |B|, |P| (p, r) of the response, with channels that are functions of time.
    const Matrix& response_sizes(int part) const { return response_sizes_[part]; }

    // Derived when first asked for; any number of runs may ask at once.
    const StrainForm& strain() const;
    const Matrix& size_factor() const;            // (n + 1, n + 1), |y| = |factor (xi, 1)|
    const Vector& static_work() const;            // (n + 1,) static loads on y
    const Vector& struck_defects() const;         // (c,) see truncation.hpp
    const WorkForms& work_forms() const;          // see work_forms.hpp

    // B = F F^T (r, r), the mobility that attached bodies leave to impacts; none without them.
    const std::optional<Matrix>& mobility() const { return data_.mobility; }

    // This level, a copy of `plain`, becomes that under a held force: its constants change (held_forces.hpp).
    void hold(const Level& plain, const Compliance& compliance, const HeldForce& force);
    void set_mobility(std::optional<Matrix> mobility) { data_.mobility = std::move(mobility); }
    // Centre d (r,) of the motion under the held force; the coordinates are eta - d.
    const Vector& centre() const { return centre_; }

    std::size_t bytes() const;

  private:
    Level(const Model& model, const Excitation& excitation);  // of the base

    void describe_modes();
    void describe_motion();
    void describe_potential();
    void describe_channels();
    void describe_guards();
    Matrix stretches() const;          // (s, n + 1) of springs that follow the force of a link: `follows`
    Matrix motion_shapes() const;      // (Psi, R, y_inf) (m, n + 1)
    std::vector<int> springs() const;  // links that act, without the rigid ones
    StrainForm make_strain() const;
    Vector make_struck_defects() const;

    const Model* model_;
    const Excitation* excitation_;
    LevelData data_;
    int number_ = -1, modes_ = 0, channels_ = 0, prescribed_ = 0;
    Vector omega_, periods_;
    double highest_frequency_ = 0.0;
    ModalResponse response_;
    Matrix displacement_acceleration_, velocity_acceleration_;
    Vector constant_acceleration_;
    Vector centre_;
    bool drives_free_modes_ = false;
    std::vector<Guard> guards_;
    std::vector<int> first_guards_;
    PotentialForm potential_;
    Matrix patterns_, carried_;
    Matrix response_sizes_[3];
    struct Derived;
    void renew_derived();
    std::shared_ptr<Derived> derived_;
};

}  // namespace multiphi
