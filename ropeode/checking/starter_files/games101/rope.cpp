// The rope of Assignment 8 of GAMES101, by each of its methods, for `ropeode grade`.
//
//     g++ -O2 -std=c++17 -o rope rope.cpp
//     ./rope semi-implicit-euler 64 > semi-implicit-euler-64.csv
//
// makes 64 steps in each frame, and prints the positions at the start and after each frame. The
// classes have the names of the assignment's, without its window and its libraries.

#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

struct Vector2D {
    double x = 0.0, y = 0.0;

    Vector2D() = default;
    Vector2D(double x, double y) : x(x), y(y) {}

    Vector2D operator+(const Vector2D& v) const { return {x + v.x, y + v.y}; }
    Vector2D operator-(const Vector2D& v) const { return {x - v.x, y - v.y}; }
    Vector2D operator*(double c) const { return {x * c, y * c}; }
    Vector2D operator/(double c) const { return {x / c, y / c}; }
    Vector2D& operator+=(const Vector2D& v) { return *this = *this + v; }
    Vector2D& operator-=(const Vector2D& v) { return *this = *this - v; }
    double norm() const { return std::sqrt(x * x + y * y); }
};

struct Mass {
    Vector2D position, last_position, velocity, forces;
    double mass = 1.0;
    bool pinned = false;
};

struct Spring {
    Mass *m1, *m2;
    double k, rest_length;
};

class Rope {
public:
    Rope(Vector2D start, Vector2D end, int num_nodes, double node_mass, double k,
         const std::vector<int>& pinned_nodes);

    void simulateEuler(double delta_t, Vector2D gravity, bool semi_implicit = true);
    void simulateVerlet(double delta_t, Vector2D gravity, bool constraints = false);

    std::vector<std::unique_ptr<Mass>> masses;
    std::vector<Spring> springs;

private:
    void pullSprings();
    void restoreLengths();
};

Rope::Rope(Vector2D start, Vector2D end, int num_nodes, double node_mass, double k,
           const std::vector<int>& pinned_nodes)
{
    for (int i = 0; i < num_nodes; ++i) {
        auto node = std::make_unique<Mass>();
        // In double: in float, nodes would be off by up to 0.00001, which is no longer the start.
        node->position = start + (end - start) * (double(i) / (num_nodes - 1));
        node->last_position = node->position;  // at rest
        node->mass = node_mass;
        masses.push_back(std::move(node));
    }
    for (int i : pinned_nodes) masses[i]->pinned = true;
    for (int i = 0; i + 1 < num_nodes; ++i) {
        Mass *a = masses[i].get(), *b = masses[i + 1].get();
        springs.push_back({a, b, k, (b->position - a->position).norm()});
    }
}

// Hooke's law: a stretched spring pulls its two ends together.
void Rope::pullSprings()
{
    for (const Spring& s : springs) {
        const Vector2D d = s.m2->position - s.m1->position;
        const Vector2D pull = d * (s.k * (d.norm() - s.rest_length) / d.norm());
        s.m1->forces += pull;
        s.m2->forces -= pull;
    }
}

// One sweep over the links: each is put back to its length, by both ends or by the free one.
void Rope::restoreLengths()
{
    for (const Spring& s : springs) {
        if (s.m1->pinned && s.m2->pinned) continue;
        const Vector2D d = s.m2->position - s.m1->position;
        const Vector2D excess = d * (1.0 - s.rest_length / d.norm());
        const double share = s.m1->pinned || s.m2->pinned ? 1.0 : 0.5;
        if (!s.m1->pinned) s.m1->position += excess * share;
        if (!s.m2->pinned) s.m2->position -= excess * share;
    }
}

void Rope::simulateEuler(double delta_t, Vector2D gravity, bool semi_implicit)
{
    pullSprings();
    for (auto& m : masses) {
        if (!m->pinned) {
            const Vector2D a = m->forces / m->mass + gravity;
            // The two methods differ in nothing but the velocity that moves the mass.
            if (semi_implicit) {
                m->velocity += a * delta_t;
                m->position += m->velocity * delta_t;
            } else {
                m->position += m->velocity * delta_t;
                m->velocity += a * delta_t;
            }
        }
        m->forces = Vector2D(0, 0);
    }
}

void Rope::simulateVerlet(double delta_t, Vector2D gravity, bool constraints)
{
    // Rigid links have no forces: their lengths are restored instead.
    if (constraints)
        restoreLengths();
    else
        pullSprings();
    for (auto& m : masses) {
        if (!m->pinned) {
            const Vector2D a = m->forces / m->mass + gravity;
            const Vector2D now = m->position;
            m->position += (now - m->last_position) + a * (delta_t * delta_t);
            m->last_position = now;
        }
        m->forces = Vector2D(0, 0);
    }
}

int main(int count, char** arguments)
{
    Rope rope(Vector2D(0, 200), Vector2D(-400, 200), 16, 1, 100, {0});
    const Vector2D gravity(0, -1);
    const std::map<std::string, std::function<void(double)>> methods = {
        {"explicit-euler", [&](double dt) { rope.simulateEuler(dt, gravity, false); }},
        {"semi-implicit-euler", [&](double dt) { rope.simulateEuler(dt, gravity, true); }},
        {"verlet-forces", [&](double dt) { rope.simulateVerlet(dt, gravity, false); }},
        {"verlet-constraints", [&](double dt) { rope.simulateVerlet(dt, gravity, true); }},
    };
    const auto chosen = methods.find(count == 3 ? arguments[1] : "");
    const int n = count == 3 ? std::atoi(arguments[2]) : 0;
    if (chosen == methods.end() || n < 1) {
        std::cerr << "usage: " << arguments[0] << " METHOD STEPS_PER_FRAME > FILE.csv\nMETHOD:";
        for (const auto& method : methods) std::cerr << " " << method.first;
        std::cerr << "\n";
        return 2;
    }
    std::cout.precision(17);  // all digits; the default of six hides the error
    std::cout << "# dt = " << 1.0 / n << "\nt,node,x,y\n";
    for (int frame = 0; frame <= 20; ++frame) {
        for (std::size_t i = 0; i < rope.masses.size(); ++i)
            std::cout << frame << "," << i << "," << rope.masses[i]->position.x << ","
                      << rope.masses[i]->position.y << "\n";
        for (int step = 0; step < n; ++step) chosen->second(1.0 / n);
    }
}
