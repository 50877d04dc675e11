% The four-bar in MATLAB or Octave: absolute coordinates, multipliers at index 1, ode45. Positions are not stabilised.
function four_bar
  L = [0.3 0.9 0.7]; m = [1 2 1.5]; J = [0.01 0.15 0.07]; g = 9.81; D = [0.8; 0];
  B = 0.3 * [cos(0.6); sin(0.6)]; d = D - B; s = d' * d;
  along = (0.9^2 - 0.7^2 + s) / (2 * s);
  C = B + along * d + sqrt(0.9^2 / s - along^2) * [-d(2); d(1)];
  P = [[0; 0] B C D]; q = zeros(9, 1);
  for i = 1:3
    e = P(:, i + 1) - P(:, i);
    q(3*i-2:3*i) = [(P(:, i) + P(:, i + 1)) / 2; atan2(e(2), e(1))];
  end
  [~, H] = rows(q, zeros(9, 1), L, D);
  v = [H; [0 0 1 0 0 0 0 0 0]] \ [zeros(8, 1); 9];  % velocities that the joints allow, the crank at 9 rad/s
  M = diag(reshape([m; m; J], [], 1)); Q = reshape([0*m; -m*g; 0*m], [], 1);
  options = odeset('RelTol', 1e-10, 'AbsTol', 1e-10);
  [~, y] = ode45(@(t, y) rates(y, M, Q, L, D), [0 2], [q; v], options);
  Phi = rows(y(end, 1:9)', y(end, 10:18)', L, D);
  fprintf('MATLAB: angle off by %.1e rad, gap %.1e m\n', abs(y(end, 3) - 14.122841131146503), norm(Phi, inf));
end

function dy = rates(y, M, Q, L, D)
  [~, H, gamma] = rows(y(1:9), y(10:18), L, D);
  x = [M H'; H zeros(8)] \ [Q; -gamma];
  dy = [y(10:18); x(1:9)];
end

function [Phi, H, gamma] = rows(q, v, L, D)
  Phi = zeros(8, 1); H = zeros(8, 9); gamma = zeros(8, 1);
  for k = 1:4  % pin k: the end of link k - 1 and the start of link k
    r = 2*k-1:2*k;
    for side = [1 -1]
      i = k - (side > 0);  % the link before, or the one after
      if i < 1 || i > 3
        if i > 3, Phi(r) = Phi(r) - D; end
        continue
      end
      c = 3*i-2:3*i; a = q(3*i); w = v(3*i); h = side * L(i) / 2;
      Phi(r) = Phi(r) + side * (q(c(1:2)) + h * [cos(a); sin(a)]);
      H(r, c) = H(r, c) + side * [eye(2), h * [-sin(a); cos(a)]];
      gamma(r) = gamma(r) - side * h * w^2 * [cos(a); sin(a)];
    end
  end
end
