// Held forces: constant forces that others hold on the structure for the length of a step, and inertia attached to it.
//
//     eta'' + D eta' + S (eta - d) = drive + p_0,   d = S^-1 p,   p_0 = (1 - S S^-1) p
//
// A constant force p on the coordinates eta of a level only shifts the centre d of their motion; S^-1 is the inverse
// on the modes of nonzero frequency, p_0 the force on the others. So a level under p is the same level with other
// constants in signals, gaps, energies and transitions, and the law is unchanged. The coordinates of such a level are
// eta - d. If p comes from forces f on points, closed rigid contacts have the reactions L f in addition.
//
// The forces are functions of the level: they act on its own modes, and contain what attached bodies give back of its
// reactions. So they are no channels, whose values transitions keep.
//
// Attached inertia leaves an impulse i the change of velocity B i, B = F F^T, and keeps its momentum where a
// transition truncates velocities.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "levels.hpp"

namespace multiphi {

// Inertia of masses and constraints that are attached to a structure.
struct AttachedInertia {
    std::function<Matrix(const Key&)> mobility;  // F (r, r) of a level
    // T' (r_m, r_l) of the modes, from that without attached inertia.
    std::function<Matrix(const Key& source, const Key& target, const Matrix&)> velocity_map;
};

// The levels of one model under held forces, for one run at a time, which keeps no summary. What has been made for one
// set of forces is used for the next one: only its constants change.
class HeldLevels : public Levels {
  public:
    using Forces = std::function<HeldForce(const Key&)>;

    using Levels::Levels;

    // Sets the forces, a function of a level's key, and the attached inertia.
    void set_forces(Forces forces, std::optional<AttachedInertia> inertia);
    const Forces& forces() const { return forces_; }
    const std::optional<AttachedInertia>& inertia() const { return inertia_; }

    const Level& level(const Key& key) override;
    const Transition& transition(const Level& source, const Level& target) override;
    const Signal& entered_signal(const Level& level, int guard) override;
    std::size_t bytes() const override;
    void forget() override;

  private:
    // Each with the number of the set of forces that it is under.
    struct HeldLevel {
        const Level* plain;
        Compliance compliance;
        Level level;
        HeldForce force;
        long set;
    };
    struct HeldTransition {
        const Transition* plain;
        Transition transition;
        long set;
    };
    struct HeldSignal {
        const Signal* plain;
        Signal signal;
        long set;
    };

    const HeldLevel& held(const Key& key);
    const Level& plain(const Level& level);

    Forces forces_;
    std::optional<AttachedInertia> inertia_;
    long set_ = 0;
    std::map<Key, std::unique_ptr<HeldLevel>> levels_;
    std::map<std::pair<const Level*, const Level*>, std::unique_ptr<HeldTransition>> transitions_;
    std::map<std::pair<const Level*, int>, std::unique_ptr<HeldSignal>> entered_;
};

}  // namespace multiphi
