// Pinocchio's articulated-body algorithm with DOP853 (Hairer, Norsett, Wanner), in minimal coordinates.
//
//   pinocchio MECHANISM TOLERANCE REPEATS
//
// The mechanism is text, as written by pinocchio.py. Prints seconds (the median of the repeats, after one run that is not
// timed), steps, and of every body its centroid and its joint's rotation matrix, row after row.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "pinocchio/fwd.hpp"  // before all else of it

#include "pinocchio/algorithm/aba.hpp"
#include "pinocchio/algorithm/kinematics.hpp"
#if __has_include("pinocchio/multibody.hpp")  // since version 4
#include "pinocchio/multibody.hpp"
#else
#include "pinocchio/multibody/data.hpp"
#include "pinocchio/multibody/model.hpp"
#endif

#include "dop853.h"  // STAGES, A, B, E3, E5: written from SciPy's coefficients

using Vector = Eigen::VectorXd;
namespace pin = pinocchio;

struct Load {
  pin::JointIndex joint;
  Eigen::Vector3d centre, force;
};

struct Mechanism {
  pin::Model model;
  std::vector<Load> loads;
  std::vector<pin::JointIndex> on;
  std::vector<Eigen::Vector3d> centres;
  std::vector<int> balls, ball_rates;  // where quaternions and their rates are
  Vector start;                        // q, v
  double end;
};

template <typename M>
static void read(std::istream& in, M& m) {
  for (int i = 0; i < m.rows(); i++)
    for (int j = 0; j < m.cols(); j++) in >> m(i, j);
}

static Mechanism load(const char* path) {
  Mechanism all;
  std::ifstream in(path);
  Eigen::Vector3d gravity;
  int joints, bodies, loads;
  in >> all.end;
  read(in, gravity);
  all.model.gravity.linear() = gravity;
  in >> joints;
  std::vector<Eigen::Vector3d> rates(joints);
  std::vector<int> kinds(joints);
  for (int i = 0; i < joints; i++) {
    int parent;
    double mass;
    Eigen::Matrix3d turn, inertia;
    Eigen::Vector3d place, centre;
    in >> kinds[i] >> parent >> mass;
    read(in, turn);
    read(in, place);
    read(in, centre);
    read(in, inertia);
    read(in, rates[i]);
    const pin::SE3 at(turn, place);
    const std::string name = "joint" + std::to_string(i);
    pin::JointIndex j;
    if (kinds[i] == 0) j = all.model.addJoint(parent + 1, pin::JointModelPZ(), at, name);
    else if (kinds[i] == 1) j = all.model.addJoint(parent + 1, pin::JointModelRZ(), at, name);
    else j = all.model.addJoint(parent + 1, pin::JointModelSpherical(), at, name);
    if (mass > 0) all.model.appendBodyToJoint(j, pin::Inertia(mass, centre, inertia), pin::SE3::Identity());
  }
  const int nq = all.model.nq;
  all.start = Vector::Zero(nq + all.model.nv);
  for (int i = 0; i < joints; i++) {
    const int q = all.model.idx_qs[i + 1], v = nq + all.model.idx_vs[i + 1];
    if (kinds[i] == 2) {
      all.balls.push_back(q);
      all.ball_rates.push_back(v);
      all.start[q + 3] = 1.0;
      all.start.segment<3>(v) = rates[i];
    } else {
      all.start[v] = rates[i][0];
    }
  }
  in >> bodies;
  for (int i = 0; i < bodies; i++) {
    int joint;
    Eigen::Vector3d centre;
    in >> joint;
    read(in, centre);
    all.on.push_back(joint + 1);
    all.centres.push_back(centre);
  }
  in >> loads;
  for (int i = 0; i < loads; i++) {
    int joint;
    Load one;
    in >> joint;
    one.joint = joint + 1;
    read(in, one.centre);
    read(in, one.force);
    all.loads.push_back(one);
  }
  if (!in) std::exit(2);
  return all;
}

class Run {
 public:
  explicit Run(const Mechanism& all) : all(all), model(all.model), data(all.model), tau(Vector::Zero(all.model.nv)) {
    fext.assign(model.njoints, pin::Force::Zero());
    n = model.nq + model.nv;
    for (auto& k : K) k = Vector::Zero(n);
    q = Vector::Zero(model.nq);
    v = Vector::Zero(model.nv);
    a = y = e3 = e5 = Vector::Zero(n);
  }

  void evaluate(const Vector& x, Vector& f) {
    q = x.head(model.nq);
    v = x.tail(model.nv);
    if (!all.loads.empty()) {  // constant in the ground's frame
      pin::forwardKinematics(model, data, q);
      for (const auto& load : all.loads) {
        const Eigen::Vector3d local = data.oMi[load.joint].rotation().transpose() * load.force;
        fext[load.joint] = pin::Force(local, load.centre.cross(local));
      }
      f.tail(model.nv) = pin::aba(model, data, q, v, tau, fext, pin::Convention::LOCAL);
    } else {
      f.tail(model.nv) = pin::aba(model, data, q, v, tau, pin::Convention::LOCAL);
    }
    if (all.balls.empty()) {
      f.head(model.nq) = v;
      return;
    }
    std::size_t ball = 0;
    for (pin::JointIndex j = 1; j < (pin::JointIndex)model.njoints; j++) {
      const int i = model.idx_qs[j], k = model.nq + model.idx_vs[j];
      if (ball < all.balls.size() && all.balls[ball] == i) {
        const double X = x[i], Y = x[i + 1], Z = x[i + 2], W = x[i + 3], b = x[k], c = x[k + 1], d = x[k + 2];
        f[i] = 0.5 * (W * b + Y * d - Z * c);
        f[i + 1] = 0.5 * (W * c + Z * b - X * d);
        f[i + 2] = 0.5 * (W * d + X * c - Y * b);
        f[i + 3] = -0.5 * (X * b + Y * c + Z * d);
        ball++;
      } else {
        f[i] = x[k];
      }
    }
  }

  int solve(double tol, Vector& x) {
    x = all.start;
    double t = 0.0, h = 0.01 * std::pow(tol, 0.125) * all.end;
    bool rejected = false;
    int steps = 0;
    evaluate(x, K[0]);
    while (t < all.end) {
      const bool last = t + 1.0000001 * h >= all.end;
      if (last) h = all.end - t;
      for (int s = 1; s < STAGES; s++) {
        combine(A[s], s, h, x);
        evaluate(y, K[s]);
      }
      combine(B, STAGES, h, x);
      const double off = error(x, h, tol);
      const double factor = 0.9 * std::pow(std::max(off, 1e-10), -0.125);
      if (off < 1.0) {
        t = last ? all.end : t + h;
        x = y;
        for (int i : all.balls) x.segment<4>(i).normalize();
        evaluate(x, K[0]);
        steps++;
        h *= std::min(rejected ? 1.0 : 10.0, std::max(0.2, factor));
        rejected = false;
      } else {
        h *= std::isnan(factor) ? 0.2 : std::max(0.2, std::min(factor, 1.0));
        rejected = true;
        if (h < 1e-14 * all.end) std::exit(3);
      }
    }
    return steps;
  }

  void print(const Vector& x) {
    pin::forwardKinematics(model, data, Vector(x.head(model.nq)));
    for (std::size_t i = 0; i < all.on.size(); i++) {
      const auto& pose = data.oMi[all.on[i]];
      const Eigen::Vector3d r = pose.act(all.centres[i]);
      const Eigen::Matrix3d& R = pose.rotation();
      std::printf("%.17g %.17g %.17g", r[0], r[1], r[2]);
      for (int k = 0; k < 9; k++) std::printf(" %.17g", R(k / 3, k % 3));
      std::printf("\n");
    }
  }

 private:
  void combine(const double* weights, int count, double h, const Vector& x) {
    a.setZero();
    for (int j = 0; j < count; j++)
      if (weights[j] != 0.0) a.noalias() += weights[j] * K[j];
    y.noalias() = x + h * a;
  }

  double error(const Vector& x, double h, double tol) {
    e3.setZero();
    e5.setZero();
    for (int j = 0; j < STAGES; j++) {
      if (E3[j] != 0.0) e3.noalias() += E3[j] * K[j];
      if (E5[j] != 0.0) e5.noalias() += E5[j] * K[j];
    }
    double s3 = 0.0, s5 = 0.0;
    for (int i = 0; i < n; i++) {
      const double scale = tol * (1.0 + std::max(std::abs(x[i]), std::abs(y[i])));
      s3 += (e3[i] / scale) * (e3[i] / scale);
      s5 += (e5[i] / scale) * (e5[i] / scale);
    }
    return s5 > 0.0 ? h * s5 / std::sqrt((s5 + 0.01 * s3) * n) : (s5 == 0.0 ? 0.0 : NAN);
  }

  const Mechanism& all;
  const pin::Model& model;
  pin::Data data;
  Vector tau, q, v, a, y, e3, e5, K[STAGES];
  PINOCCHIO_ALIGNED_STD_VECTOR(pin::Force) fext;
  int n;
};

int main(int count, char** arguments) {
  if (count != 4) return 1;
  const Mechanism all = load(arguments[1]);
  const double tol = std::atof(arguments[2]);
  Run run(all);
  Vector x;
  int steps = run.solve(tol, x);
  std::vector<double> seconds;
  for (int i = 0; i < std::atoi(arguments[3]); i++) {
    const auto started = std::chrono::steady_clock::now();
    steps = run.solve(tol, x);
    seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count());
  }
  std::nth_element(seconds.begin(), seconds.begin() + seconds.size() / 2, seconds.end());
  std::printf("%.9g %d\n", seconds[seconds.size() / 2], steps);
  run.print(x);
}
