// MRPT's reactive planners through BARN and DynaBARN worlds, on the planar robot of the simulator: a peer for `sinew barn`.
//
//   barn_mrpt --data DIR [--dynamic] [--method full-eval|nd|vff] [--speed M_S] [--from A] [--to B] [--every N] [--seed S] [--json]
//
// The settings are MRPT's shipped example (reactive2d_config.ini beside this file, unchanged but for what is set here and
// said in README.md): greatest speed, 90°/s, reference distance 4 m, the shape 2 cm larger than the robot, the obstacle
// filter off. 10 Hz control, exact pose, 720 beams over 270° with σ 1 mm, 0.12 m ahead of the centre.
#include "world.hpp"

#include <mrpt/config/CConfigFile.h>
#include <mrpt/config/CConfigFileMemory.h>
#include <mrpt/kinematics/CVehicleSimul_DiffDriven.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/nav/reactive/CReactiveNavigationSystem.h>
#include <mrpt/nav/reactive/CRobot2NavInterfaceForSimulator.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <iostream>
#include <random>

using namespace mrpt::nav;

namespace {

constexpr int BEAMS = 720;
constexpr double RANGE_M = 30, LASER_X = 0.12, CONTROL_S = 0.1, SUBSTEP_S = 0.01;

struct Arguments {
    std::string data, method = "full-eval", settings = "reactive2d_config.ini";
    bool dynamic = false, json = false;
    double speed = 1.0;
    int every = 1, from = 0, to = 1 << 30, seed = 0;
};

class Robot : public CRobot2NavInterfaceForSimulator_DiffDriven {
   public:
    Robot(mrpt::kinematics::CVehicleSimul_DiffDriven& body, const World& world, int seed)
        : CRobot2NavInterfaceForSimulator_DiffDriven(body), body_(body), world_(world), chance_(seed * 1000 + world.index) {
        setMinLoggingLevel(mrpt::system::LVL_ERROR);
    }

    bool senseObstacles(mrpt::maps::CSimplePointsMap& obstacles, mrpt::system::TTimeStamp& stamp) override {
        obstacles.clear();
        const auto clock = std::chrono::steady_clock::now();
        stamp = mrpt::system::now();
        const auto pose = body_.getCurrentGTPose();
        const auto discs = world_.at(body_.getTime());
        std::normal_distribution<double> noise(0, 0.001);
        const double x = pose.x + LASER_X * std::cos(pose.phi), y = pose.y + LASER_X * std::sin(pose.phi);
        for (int k = 0; k < BEAMS; k++) {
            const double bearing = (-135 + 270.0 * k / (BEAMS - 1)) * M_PI / 180;
            const double ux = std::cos(pose.phi + bearing), uy = std::sin(pose.phi + bearing);
            double range = cast(discs, world_.walls, x, y, ux, uy, RANGE_M);
            if (range >= RANGE_M) continue;
            range += noise(chance_);
            obstacles.insertPoint(LASER_X + range * std::cos(bearing), range * std::sin(bearing), 0);
        }
        sensing_ms += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - clock).count();
        return true;
    }

    // What the simulated laser took: no part of the planner's time.
    double sensing_ms = 0;

   private:
    mrpt::kinematics::CVehicleSimul_DiffDriven& body_;
    const World& world_;
    std::mt19937 chance_;
};

struct Outcome { bool success = false, collided = false; double time = 100, score = 0, step_ms = 0; };

mrpt::config::CConfigFileMemory settings(const Arguments& args) {
    std::ifstream file(args.settings);
    if (!file) throw std::runtime_error("cannot read " + args.settings + ": give --settings reactive2d_config.ini");
    std::stringstream all;
    std::string line;
    while (std::getline(file, line)) {
        if (line.rfind("@define ROBOT_MAX_V", 0) == 0) line = "@define ROBOT_MAX_V  " + std::to_string(args.speed);
        if (line.rfind("@define ROBOT_MAX_W", 0) == 0) line = "@define ROBOT_MAX_W  90.0";
        if (line.rfind("@define NAV_MAX_REF_DIST", 0) == 0) line = "@define NAV_MAX_REF_DIST  4.0";
        all << line << "\n";
    }
    mrpt::config::CConfigFileMemory config;
    config.setContent(all.str());
    const std::map<std::string, std::string> methods = {
        {"full-eval", "CHolonomicFullEval"}, {"nd", "CHolonomicND"}, {"vff", "CHolonomicVFF"}};
    const std::string base = "CAbstractPTGBasedReactive", robot = "CReactiveNavigationSystem";
    config.write(base, "holonomic_method", methods.at(args.method));
    config.write(base, "enable_obstacle_filtering", std::string("false"));
    config.write(robot, "RobotModel_shape2D_xs", std::string("-0.274 0.274 0.274 -0.274"));
    config.write(robot, "RobotModel_shape2D_ys", std::string("0.235 0.235 -0.235 -0.235"));
    return config;
}

Outcome run(const World& world, const Arguments& args, const mrpt::config::CConfigFileMemory& config) {
    mrpt::kinematics::CVehicleSimul_DiffDriven body;
    body.setDelayModelParams(0, 0);
    body.setCurrentGTPose({world.start_x, world.start_y, world.start_heading});
    Robot robot(body, world, args.seed);
    CReactiveNavigationSystem navigator(robot, false, false);
    navigator.setMinLoggingLevel(mrpt::system::LVL_ERROR);
    navigator.enableTimeLog(false);
    navigator.loadConfigFile(config);
    navigator.initialize();
    CAbstractPTGBasedReactive::TNavigationParams order;
    order.target.target_coords.x = world.goal_x;
    order.target.target_coords.y = world.goal_y;
    order.target.targetAllowedDistance = 0.4;
    order.target.targetIsRelative = false;
    navigator.navigate(&order);

    Outcome out;
    double began = -1, spent_ms = 0;
    int steps = 0;
    while (body.getTime() < 130) {
        const auto clock = std::chrono::steady_clock::now();
        navigator.navigationStep();
        spent_ms += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - clock).count();
        steps++;
        out.step_ms = (spent_ms - robot.sensing_ms) / steps;
        for (double t = 0; t < CONTROL_S - 1e-9; t += SUBSTEP_S) {
            body.simulateOneTimeStep(SUBSTEP_S);
            const auto pose = body.getCurrentGTPose();
            const double now = body.getTime();
            if (began < 0 && std::hypot(pose.x - world.start_x, pose.y - world.start_y) > 0.1) began = now;
            const double spent = began < 0 ? 0 : now - began;
            if (touches(world.at(now), world.walls, pose.x, pose.y, pose.phi)) {
                out.collided = true;
                out.time = spent;
                return out;
            }
            if (std::hypot(pose.x - world.goal_x, pose.y - world.goal_y) <= 1) {
                out.success = true;
                out.time = spent;
                out.score = score(world.path_m, spent);
                return out;
            }
            if (spent >= 100) return out;
        }
        // A navigator that gave up is told again: the benchmark's clock runs on.
        if (navigator.getCurrentState() != CAbstractNavigator::NAVIGATING) {
            navigator.resetNavError();
            navigator.navigate(&order);
        }
    }
    return out;
}

}  // namespace

int main(int argc, char** argv) try {
    Arguments args;
    for (int k = 1; k < argc; k++) {
        const std::string key = argv[k];
        const auto value = [&] {
            if (k + 1 >= argc) throw std::runtime_error(key + " needs a value");
            return std::string(argv[++k]);
        };
        if (key == "--data") args.data = value();
        else if (key == "--dynamic") args.dynamic = true;
        else if (key == "--json") args.json = true;
        else if (key == "--method") args.method = value();
        else if (key == "--settings") args.settings = value();
        else if (key == "--speed") args.speed = std::stod(value());
        else if (key == "--every") args.every = std::stoi(value());
        else if (key == "--from") args.from = std::stoi(value());
        else if (key == "--to") args.to = std::stoi(value());
        else if (key == "--seed") args.seed = std::stoi(value());
        else throw std::runtime_error("unknown argument " + key);
    }
    auto worlds = args.dynamic ? read_dynabarn(args.data) : read_barn(args.data);
    worlds.erase(std::remove_if(worlds.begin(), worlds.end(),
                                [&](const World& w) { return w.index < args.from || w.index >= args.to; }),
                 worlds.end());
    if (worlds.empty()) throw std::runtime_error("no worlds in \"" + args.data + "\": give --data DIR");
    const auto config = settings(args);
    int runs = 0, won = 0, hit = 0;
    double time = 0, total = 0, step = 0;
    std::string rows;
    for (size_t k = 0; k < worlds.size(); k += args.every) {
        const Outcome out = run(worlds[k], args, config);
        runs++;
        won += out.success;
        hit += out.collided;
        time += out.success ? out.time : 0;
        total += out.score;
        step += out.step_ms;
        const char* end = out.success ? "success" : out.collided ? "collision" : "timeout";
        std::cerr << "world " << worlds[k].index << " " << end << " " << out.time << " s\n";
        rows += (rows.empty() ? "" : ",") + std::string("\n    {\"world\": ") + std::to_string(worlds[k].index) +
                ", \"end\": \"" + end + "\", \"time_s\": " + std::to_string(out.time) + ", \"score\": " +
                std::to_string(out.score) + "}";
    }
    std::printf("{\"peer\": \"MRPT %s at %.1f m/s\", \"runs\": %d, \"success\": %.4f, \"collisions\": %.4f, \"timeouts\": %.4f, "
                "\"mean_time_s\": %.3f, \"score\": %.4f, \"mean_step_ms\": %.3f",
                args.method.c_str(), args.speed, runs, double(won) / runs, double(hit) / runs, double(runs - won - hit) / runs,
                won ? time / won : 0.0, total / runs, step / runs);
    if (args.json) std::printf(", \"worlds\": [%s\n  ]", rows.c_str());
    std::printf("}\n");
} catch (const std::exception& error) {
    std::cerr << "barn_mrpt: " << error.what() << "\n";
    return 1;
}
