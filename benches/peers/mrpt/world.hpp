// BARN and DynaBARN worlds, exact beams, and the benchmark's rules: the same geometry as the simulator's.
#pragma once
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

struct Disc { double x, y, r; };
struct Wall { double ax, ay, bx, by; };
struct Key { double t, x, y; };
struct Round { double period; std::vector<Key> keys; };

struct World {
    int index = 0;
    std::vector<Disc> discs;
    std::vector<Wall> walls;
    std::vector<Round> rounds;
    double start_x = 0, start_y = 0, start_heading = 0, goal_x = 0, goal_y = 0, path_m = 0;

    // Everything round, at a time.
    std::vector<Disc> at(double time) const {
        std::vector<Disc> all = discs;
        for (const Round& round : rounds) {
            const double clock = std::fmod(time, round.period);
            size_t k = 1;
            while (k + 1 < round.keys.size() && round.keys[k].t <= clock) k++;
            const Key &a = round.keys[k - 1], &b = round.keys[k];
            const double s = std::min(1.0, std::max(0.0, (clock - a.t) / (b.t - a.t)));
            all.push_back({a.x + (b.x - a.x) * s, a.y + (b.y - a.y) * s, 0.5});
        }
        return all;
    }
};

inline std::vector<World> read_barn(const std::string& folder) {
    std::map<int, double> lengths;
    std::ifstream table(folder + "/worlds.csv");
    std::string line;
    std::getline(table, line);
    while (std::getline(table, line)) {
        std::stringstream row(line);
        std::string cell;
        std::vector<std::string> cells;
        while (std::getline(row, cell, ',')) cells.push_back(cell);
        if (cells.size() > 5) lengths[std::stoi(cells[0])] = std::stod(cells[5]);
    }
    std::vector<World> all;
    std::ifstream grids(folder + "/grids.txt");
    while (std::getline(grids, line)) {
        if (line.rfind("world ", 0) != 0) continue;
        World world;
        world.index = std::stoi(line.substr(6));
        for (int r = 0; r < 30 && std::getline(grids, line); r++)
            for (int c = 0; c < 30; c++)
                if (line[c] == '#') world.discs.push_back({-4.425 + 0.15 * r, 5.175 + 0.15 * c, 0.075});
        for (int k = 0; k < 30; k++) world.discs.push_back({-4.425 + 0.15 * k, 0.075, 0.075});
        for (int k = 1; k <= 33; k++)
            for (double x : {-4.425, -0.075}) world.discs.push_back({x, 0.075 + 0.15 * k, 0.075});
        world.start_x = -2.25, world.start_y = 3.0, world.start_heading = M_PI / 2;
        world.goal_x = -2.25, world.goal_y = 13.0;
        world.path_m = lengths[world.index];
        all.push_back(world);
    }
    return all;
}

inline std::vector<World> read_dynabarn(const std::string& folder) {
    std::vector<World> all;
    std::ifstream file(folder + "/worlds.txt");
    std::string line;
    while (std::getline(file, line)) {
        std::stringstream row(line);
        std::string name;
        row >> name;
        if (name == "world") {
            World world;
            row >> world.index;
            for (double h : {9.75, 10.25}) {
                world.walls.push_back({-h, -h, -h, h});
                world.walls.push_back({-h, h, 10.0, h});
                world.walls.push_back({-h, -h, 10.0, -h});
            }
            world.start_x = 11, world.start_heading = M_PI, world.goal_x = -9, world.path_m = 20;
            all.push_back(world);
        } else if (!name.empty() && !all.empty()) {
            Round round;
            int count;
            row >> round.period >> count;
            std::string key;
            while (row >> key) {
                Key k;
                if (std::sscanf(key.c_str(), "%lf,%lf,%lf", &k.t, &k.x, &k.y) == 3) round.keys.push_back(k);
            }
            if (round.keys.size() > 1) all.back().rounds.push_back(round);
        }
    }
    return all;
}

// Distance along a ray to the first surface, at most `most`.
inline double cast(const std::vector<Disc>& discs, const std::vector<Wall>& walls, double x, double y, double ux, double uy,
                   double most) {
    double best = most;
    for (const Disc& d : discs) {
        const double dx = d.x - x, dy = d.y - y, along = dx * ux + dy * uy, aside = dx * uy - dy * ux;
        const double left = d.r * d.r - aside * aside;
        if (along > 0 && left > 0) best = std::min(best, std::max(0.0, along - std::sqrt(left)));
    }
    for (const Wall& w : walls) {
        const double ex = w.bx - w.ax, ey = w.by - w.ay, ox = w.ax - x, oy = w.ay - y, cross = ux * ey - uy * ex;
        if (std::fabs(cross) < 1e-12) continue;
        const double t = (ox * ey - oy * ex) / cross, s = (ox * uy - oy * ux) / cross;
        if (t > 0 && s >= 0 && s <= 1) best = std::min(best, t);
    }
    return best;
}

// Distance of a point, in the robot's frame, from its rectangle; 0 within.
inline double gap(double x, double y) {
    const double ax = std::max(0.0, std::fabs(x) - 0.254), ay = std::max(0.0, std::fabs(y) - 0.215);
    return std::hypot(ax, ay);
}

inline bool touches(const std::vector<Disc>& discs, const std::vector<Wall>& walls, double x, double y, double heading) {
    const double c = std::cos(heading), s = std::sin(heading);
    for (const Disc& d : discs) {
        const double dx = d.x - x, dy = d.y - y;
        if (gap(c * dx + s * dy, c * dy - s * dx) <= d.r) return true;
    }
    for (const Wall& w : walls)
        for (int k = 0; k <= 1000; k++) {
            const double dx = w.ax + (w.bx - w.ax) * k / 1000 - x, dy = w.ay + (w.by - w.ay) * k / 1000 - y;
            if (gap(c * dx + s * dy, c * dy - s * dx) <= 0) return true;
        }
    return false;
}

inline double score(double path_m, double time) {
    const double ideal = path_m / 2;
    return ideal / std::min(8 * ideal, std::max(2 * ideal, time));
}
