// A rope of point masses and springs by Verlet's method, for `ropeode grade`.
//
//     g++ -O2 -std=c++17 -o rope rope.cpp
//     ./rope 64 > rope-64.csv
//
// makes 64 steps in each frame. It reads initial.csv, and prints the state at the start and
// after each frame.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

// The parameters in spec.toml.
@NUMBERS@

using Vector = std::array<double, dim>;

struct State {
    std::vector<Vector> x, v;
};

State read_initial(const std::string& path)
{
    std::ifstream file(path);
    std::string line;
    std::getline(file, line);  // the header: t,node, coordinates, velocities
    State s;
    while (std::getline(file, line)) {
        std::replace(line.begin(), line.end(), ',', ' ');
        std::istringstream fields(line);
        double t;
        int node;
        Vector x{}, v{};
        fields >> t >> node;
        for (double& c : x) fields >> c;
        for (double& c : v) fields >> c;
        s.x.push_back(x);
        s.v.push_back(v);
    }
    if (s.x.size() != nodes) {
        std::cerr << path << ": " << s.x.size() << " nodes instead of " << nodes << "\n";
        std::exit(2);
    }
    return s;
}

// All forces except damping.
std::vector<Vector> forces(const State& s)
{
    std::vector<Vector> f(nodes);
    for (int i = 0; i < nodes; ++i)
        for (int c = 0; c < dim; ++c) f[i][c] = mass[i] * gravity[c];
    for (int i = 0; i + 1 < nodes; ++i) {
        Vector d{};
        double square = 0.0;
        for (int c = 0; c < dim; ++c) {
            d[c] = s.x[i + 1][c] - s.x[i][c];
            square += d[c] * d[c];
        }
        const double length = std::sqrt(square);
        if (length == 0.0) continue;  // no direction, no force
        const double pull = stiffness[i] * (length - rest_length[i]) / length;
        for (int c = 0; c < dim; ++c) {
            f[i][c] += pull * d[c];
            f[i + 1][c] -= pull * d[c];
        }
    }
    return f;
}

// Half a kick, a drift, half a kick. Damping uses the velocity at the beginning of the first
// kick and at the end of the second, which keeps order 2.
void step(State& s, std::vector<Vector>& f, double dt)
{
    for (int i = 0; i < nodes; ++i) {
        if (pinned[i]) continue;
        for (int c = 0; c < dim; ++c) {
            s.v[i][c] += 0.5 * dt * (f[i][c] - damping[i] * s.v[i][c]) / mass[i];
            s.x[i][c] += dt * s.v[i][c];
        }
    }
    f = forces(s);
    for (int i = 0; i < nodes; ++i) {
        if (pinned[i]) continue;
        for (int c = 0; c < dim; ++c)
            s.v[i][c] = (s.v[i][c] + 0.5 * dt * f[i][c] / mass[i])
                / (1.0 + 0.5 * dt * damping[i] / mass[i]);
    }
}

void print(int frame, const State& s)
{
    for (int i = 0; i < nodes; ++i) {
        std::cout << frame << "," << i;
        for (double c : s.x[i]) std::cout << "," << c;
        for (double c : s.v[i]) std::cout << "," << c;
        std::cout << "\n";
    }
}

int main(int count, char** arguments)
{
    const int steps = count == 2 ? std::atoi(arguments[1]) : 0;
    if (steps < 1) {
        std::cerr << "usage: " << arguments[0] << " STEPS_PER_FRAME > FILE.csv\n";
        return 2;
    }
    const double dt = 1.0 / steps;
    State s = read_initial("initial.csv");
    std::vector<Vector> f = forces(s);
    std::cout.precision(17);  // all digits; the default of six hides the error
    std::cout << "# dt = " << dt << "\n" << header << "\n";
    print(0, s);
    for (int frame = 1; frame <= frames; ++frame) {
        for (int i = 0; i < steps; ++i) step(s, f, dt);
        print(frame, s);
    }
}
